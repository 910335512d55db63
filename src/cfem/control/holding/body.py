"""The rigid body that robots hold: its shape, how it is drawn, and the table under it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from cfem.contact.obstacle import Box, ClosedMesh, Cylinder, Obstacle, Sphere
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.control.holding.spec import ObjectSpec
from cfem.core.errors import SpecError, located
from cfem.core.stl import read_stl
from cfem.equilibrium.contact.ground import Pads
from cfem.robot.mesh.placement import rotation_of

TABLE = 0.01  # mm/N of each of the four points of a table, in every direction
WITHIN = 0.8  # of the way from the middle of what stands on a table to its corners, where these points are
LEVEL = 1e-6  # of the body's size: how much higher than the lowest point what stands on a table may be
UPRIGHT = np.eye(3)
ROUND = 24  # corners of a circle that is drawn


@dataclass(frozen=True, eq=False)
class HeldBody:
    """A rigid body where it begins.

    shape: placed
    centre: (3,) mm, its centre of mass
    vertices (k, 3) mm and triangles (t, 3): of its surface, of a round one as it is drawn"""

    shape: Obstacle
    centre: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray

    @cached_property
    def radius(self) -> float:
        """mm from the centre to the farthest point."""
        return float(np.linalg.norm(self.vertices - self.centre, axis=1).max())

    def facets(self, width: int) -> tuple[np.ndarray, np.ndarray]:
        """Points (k, 3) mm and facets of the surface: of 3, 4 or 6 nodes, as the mesh of the robots has (width)."""
        if width == 3:
            return self.vertices, self.triangles
        if width == 4:
            return self.vertices, self.triangles[:, [0, 1, 2, 2]]
        ends = self.vertices[self.triangles]  # (t, 3, 3)
        both = np.concatenate([ends, (ends + np.roll(ends, -1, axis=1)) / 2], axis=1)
        return both.reshape(-1, 3), np.arange(6 * len(ends)).reshape(-1, 6)

    def table(self, force: np.ndarray) -> Pads:
        """Table under the side that a force (3,) N points to most, along an axis of the scene, as four points of it.
        SpecError where the body does not stand on an area there."""
        axis = int(np.abs(force).argmax())
        height = -np.sign(force[axis]) * self.vertices[:, axis]
        stands = self.vertices[height <= height.min() + LEVEL * self.radius]
        beside = np.delete(np.arange(3), axis)
        corners = np.array([[i, j] for i in (-1.0, 1.0) for j in (-1.0, 1.0)])
        four = stands[np.argmax(corners @ stands[:, beside].T, axis=1)]
        pads = four.mean(axis=0) + WITHIN * (four - four.mean(axis=0))
        flat = len(stands) > 2 and np.linalg.svd(stands - stands.mean(axis=0))[1][1] > LEVEL * self.radius
        if not flat or np.abs(self.shape.distance(pads)).max() > LEVEL * self.radius:
            do = "turn it by object.rotate so that it stands on a flat side, or leave the table out"
            raise SpecError("the object does not stand on a flat side of four corners", where="object.table", do=do)
        return Pads(pads, TABLE)


def body_of(spec: ObjectSpec, folder: Path) -> HeldBody:
    """The body that a spec in `folder` states. InputError where its file holds no closed surface."""
    R, centre = rotation_of(spec.rotate), np.asarray(spec.centre, float)
    if spec.half_size is not None:
        return box_body(centre, spec.half_size, R)
    if spec.file is not None:
        with located(folder / spec.file):
            surface = ClosedSurface(*read_stl(folder / spec.file, spec.unit))
        t = centre - R @ _centroid(surface)
        return HeldBody(ClosedMesh(surface, R=R, t=t), centre, surface.vertices @ R.T + t, surface.triangles)
    angles = 2 * np.pi * np.arange(ROUND) / ROUND
    if spec.half_length is not None:
        shape: Obstacle = Cylinder(spec.radius, spec.half_length, R=R, t=centre)
        circle = spec.radius * np.column_stack([np.cos(angles), np.sin(angles)])
        points = np.vstack([np.column_stack([circle, np.full(ROUND, side * spec.half_length)]) for side in (-1, 1)])
    else:
        shape = Sphere(spec.radius, R=R, t=centre)
        heights = np.cos(angles[1 : ROUND // 2])
        around = np.column_stack([np.cos(angles), np.sin(angles)])
        rings = [np.column_stack([np.sqrt(1 - z * z) * around, np.full(ROUND, z)]) for z in heights]
        points = spec.radius * np.vstack([*rings, [[0, 0, 1], [0, 0, -1]]])
    return HeldBody(shape, centre, points @ R.T + centre, _outward(points))


def box_body(centre: Sequence[float], half_size: Sequence[float], R: np.ndarray = UPRIGHT) -> HeldBody:
    """A box of half edges (3,) mm about a centre (3,) mm, turned by R (3, 3)."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], float)
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    triangles, half = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]]), np.asarray(half_size, float)
    t = np.asarray(centre, float)
    return HeldBody(Box(half, R=R, t=t), t, (signs * half) @ R.T + t, triangles)


def _centroid(surface: ClosedSurface) -> np.ndarray:
    """(3,) mm of the volume within a closed surface: that of the tetrahedra from its triangles to the origin."""
    corners = surface.vertices[surface.triangles] - surface.vertices.mean(axis=0)
    volumes = np.linalg.det(corners)
    return surface.vertices.mean(axis=0) + volumes @ corners.sum(axis=1) / (4 * volumes.sum())


def _outward(points: np.ndarray) -> np.ndarray:
    """Triangles (t, 3) of the convex hull of points (k, 3) about the origin, normals outward."""
    triangles = ConvexHull(points).simplices
    inward = np.linalg.det(points[triangles]) < 0
    return np.where(inward[:, None], triangles[:, ::-1], triangles)
