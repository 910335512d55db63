"""Geoms of a MuJoCo model as obstacles, in mm."""

from collections.abc import Collection
from typing import Any

import mujoco
import numpy as np
from numba import njit
from scipy.spatial import ConvexHull

from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Cylinder, Ellipsoid, Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.contact.surface.triangles import normals_of
from cfem.core.errors import InputError

MM = 1000.0  # of MuJoCo's metre


class Geoms:
    """Geoms of a model that collide, but for those on the bodies that robots are fixed to. InputError where the shape
    of one is not known.

    numbers: (n,) of the geoms
    bodies: (n,) numbers of their bodies, -1 of those that no joint moves"""

    def __init__(self, model: mujoco.MjModel, carriers: Collection[int]):
        """carriers: bodies that robots are fixed to; the world's own geoms always take part."""
        collide = (model.geom_contype | model.geom_conaffinity) != 0
        carried = np.isin(model.geom_bodyid, [body for body in carriers if body > 0])
        self.numbers = np.flatnonzero(collide & ~carried)
        body = model.geom_bodyid[self.numbers]
        self.bodies = np.where(model.body_weldid[body] > 0, body, -1)
        self.names = [name_of(model, mujoco.mjtObj.mjOBJ_GEOM, number) for number in self.numbers.tolist()]
        self._shapes = ObstacleSet(
            [_shape(model, *each) for each in zip(self.numbers.tolist(), self.names, strict=True)]
        )

    def placed(self, data: mujoco.MjData) -> ObstacleSet:
        """The geoms where `data` has them."""
        return self._shapes.posed(*poses(data.geom_xmat, data.geom_xpos, self.numbers))


@njit(cache=True, error_model="numpy")
def poses(xmat, xpos, numbers):
    """R (n, 3, 3) and t (n, 3) mm of those of these numbers (n,) among poses (N, 9) and (N, 3) m of MuJoCo."""
    R, t = np.empty((len(numbers), 3, 3)), np.empty((len(numbers), 3))
    for i in range(len(numbers)):
        for a in range(3):
            t[i, a] = xpos[numbers[i], a] * MM
            for b in range(3):
                R[i, a, b] = xmat[numbers[i], 3 * a + b]
    return R, t


@njit(cache=True, error_model="numpy")
def ways(t, xpos, numbers):
    """(n, 3) mm of those of these numbers (n,) among places (N, 3) m to places t (n, 3) mm; the largest of their
    entries."""
    by, largest = np.empty((len(numbers), 3)), 0.0
    for i in range(len(numbers)):
        for a in range(3):
            by[i, a] = t[i, a] - xpos[numbers[i], a] * MM
            largest = max(largest, abs(by[i, a]))
    return by, largest


def name_of(model: mujoco.MjModel, kind: Any, number: int) -> str:
    """Name of an object, or its kind and number where it has none."""
    return mujoco.mj_id2name(model, kind, number) or f"{kind.name.removeprefix('mjOBJ_').lower()} {number}"


def _shape(model: mujoco.MjModel, number: int, name: str) -> Any:
    """The shape about its own origin."""
    size, kind = model.geom_size[number] * MM, mujoco.mjtGeom(int(model.geom_type[number]))
    match kind:
        case mujoco.mjtGeom.mjGEOM_PLANE:
            return Plane()
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return Sphere(float(size[0]))
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return Capsule(float(size[0]), float(size[1]))
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            return Cylinder(float(size[0]), float(size[1]))
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return Ellipsoid(size)
        case mujoco.mjtGeom.mjGEOM_BOX:
            return Box(size)
        case mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[number]
            first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
            return ClosedMesh(_hull(model.mesh_vert[first : first + count].astype(float) * MM))
        case mujoco.mjtGeom.mjGEOM_HFIELD:
            return ClosedMesh(_height_field(model, model.geom_dataid[number]))
    what = f"geom '{name}' is of a kind, {kind.name.removeprefix('mjGEOM_').lower()}, that soft robots do not touch"
    known = "plane, sphere, capsule, cylinder, ellipsoid, box, mesh or hfield"
    do = f"take a {known}, or let it not collide: contype=conaffinity=0"
    raise InputError(what, do=do)


def _hull(points: np.ndarray) -> ClosedSurface:
    """Convex hull, as MuJoCo collides meshes."""
    hull = ConvexHull(points)
    corners = points[hull.simplices]
    normals = normals_of(corners)
    inwards = (normals * hull.equations[:, :3]).sum(axis=1) < 0
    triangles = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    order = np.full(len(points), -1)
    order[hull.vertices] = np.arange(len(hull.vertices))
    return ClosedSurface(points[hull.vertices], order[triangles])


def _height_field(model: mujoco.MjModel, number: int) -> ClosedSurface:
    """Top of a height field, its cells cut in two as MuJoCo cuts them, with walls down to its base."""
    rows, columns, first = model.hfield_nrow[number], model.hfield_ncol[number], model.hfield_adr[number]
    half_x, half_y, height, base = model.hfield_size[number] * MM
    y, x = np.meshgrid(np.linspace(-half_y, half_y, rows), np.linspace(-half_x, half_x, columns), indexing="ij")
    z = model.hfield_data[first : first + rows * columns].reshape(rows, columns) * height
    top = np.stack([x, y, z], axis=2).reshape(-1, 3)
    nodes = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = nodes[:-1, :-1].ravel(), nodes[:-1, 1:].ravel(), nodes[1:, 1:].ravel(), nodes[1:, :-1].ravel()
    upwards = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    rim = np.concatenate([nodes[0, :-1], nodes[:-1, -1], nodes[-1, :0:-1], nodes[:0:-1, 0]])  # anticlockwise from above
    after, below = np.roll(rim, -1), len(top)
    walls = [[rim + below, after + below, after], [rim + below, after, rim]]
    triangles = np.concatenate([upwards, upwards[:, ::-1] + below, *(np.stack(wall, axis=1) for wall in walls)])
    bottom = np.column_stack([top[:, :2], np.full(len(top), -base)])
    return ClosedSurface(np.concatenate([top, bottom]), triangles)
