"""The free form of a robot as the user writes it: what moves its surface, and what thickens its walls."""

from typing import Literal

from pydantic import Field

from cfem.core.spec import Spec
from cfem.core.units import Length, Point


class Control(Spec):
    """A point that takes its surroundings along, less and less up to a radius. All that lies there moves: the body,
    the points of cables, contacts and loads, and effectors. Pull points stay."""

    at: Point
    """Place of the point, on the surface or anywhere near the body."""
    move: Point
    """Where the point moves along x, y and z. What lies under several points moves by the sum."""
    radius: Length = Field(gt=0)
    """Distance up to which the surroundings move."""
    mirror: Literal["x", "y", "z"] | None = None
    """Axis across whose plane through the origin a mirror image of the point moves too."""


class WallThickness(Spec):
    """A place at which the wall of a cavity becomes thicker: its surface moves into the cavity, less and less up to a
    radius, and the opposite side stays. Give a point inside the cavity, or a surface."""

    inside: Point | None = None
    """A point in the void."""
    surface: str | None = None
    """Name of a facet set of the mesh file."""
    at: Point
    """Place on the wall."""
    thicker: Length
    """How much thicker the wall becomes there. Negative: thinner."""
    radius: Length = Field(gt=0)
    """Distance up to which the wall changes."""

    def check(self) -> None:
        if (self.inside is None) == (self.surface is None):
            raise ValueError("give one of inside and surface")


class FreeForm(Spec):
    """A deformation of the geometry that the scene describes. All places in the scene are those before it."""

    controls: list[Control] = []
    """Points that move with their surroundings."""
    walls: list[WallThickness] = []
    """Places at which walls become thicker or thinner."""
