"""Solid geometry as data: a small tree of primitives and Boolean operations, in mm, written without a CAD kernel."""

from dataclasses import dataclass, fields
from typing import Any

Point = tuple[float, float, float]


@dataclass(frozen=True)
class Box:
    """A box between two opposite corners."""

    low: Point
    high: Point


@dataclass(frozen=True)
class Prism:
    """A polygon ((y, z), ...) extruded along x from x_low to x_high."""

    polygon: tuple[tuple[float, float], ...]
    x_low: float
    x_high: float


@dataclass(frozen=True)
class Frustum:
    """A cone from radius r0 at `base` to radius r1 at base + axis."""

    base: Point
    axis: Point
    r0: float
    r1: float


@dataclass(frozen=True)
class Loft:
    """Straight from one polygon in space to another of as many corners, each edge parallel to its fellow: all sides are
    flat, so straight-edged cells fill it exactly."""

    first: tuple[Point, ...]
    second: tuple[Point, ...]


@dataclass(frozen=True)
class Union:
    parts: tuple["Solid", ...]


@dataclass(frozen=True)
class Difference:
    """The solid `whole`, from which `parts` are cut."""

    whole: "Solid"
    parts: tuple["Solid", ...]


@dataclass(frozen=True)
class File:
    """A STEP or BREP solid. unit: size in mm of a BREP file's numbers, which has none (of STEP, 1)."""

    path: str
    unit: float = 1.0


@dataclass(frozen=True)
class SurfaceSolid:
    """The volume that the closed surface in a file bounds. unit: size in mm of its numbers; body: of several, the
    largest first."""

    path: str
    unit: float = 1.0
    body: int = 1


@dataclass(frozen=True)
class Placed:
    """`solid` turned by `angle` (rad) about the line through the origin along `axis`, then moved by `translate`."""

    solid: "Solid"
    axis: Point
    angle: float
    translate: Point


Solid = Box | Prism | Frustum | Loft | Union | Difference | File | SurfaceSolid | Placed


def as_data(solid: Solid) -> dict[str, Any]:
    """Plain data for the mesher's process: {'kind': class name, field: value, ...}."""

    def convert(value: Any) -> Any:
        if isinstance(value, Solid):
            return as_data(value)
        return [convert(item) for item in value] if isinstance(value, tuple) else value

    return {"kind": type(solid).__name__, **{item.name: convert(getattr(solid, item.name)) for item in fields(solid)}}
