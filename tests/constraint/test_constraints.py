"""The battery that every constraint and every effector passes: gradient, curvature, value at rest, virtual work of a
rigid motion, and what follows a rigid motion of any size."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from constraint.meshes import MIDDLE, bricks, hollow
from scipy.spatial.transform import Rotation
from support.blocks import block

from cfem.condensed.rotation import inverse_left_jacobian
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.cavity import enclosed, make_cavity
from cfem.constraint.contact import make_contact
from cfem.constraint.effector import make_effector
from cfem.constraint.protocol import Watched
from cfem.mechanics.mesh import Mesh

MESH = block((20, 10, 10), (4, 2, 2), order=2)
BRICKS = bricks((20, 10, 10), (4, 2, 2), distort=0.3)
PULL = np.array([-2.0, 3, 4])
TURN = Rotation.from_rotvec([0.9, -1.5, 0.6])  # 1.85 rad


@dataclass(frozen=True)
class Case:
    """work(row, x, shift, spin): what delta changes by in the rigid velocity shift + spin x position;
    moved(rest, turn, shift): the value after a rigid motion from rest, None where it depends on something outside."""

    mesh: Mesh
    row: Watched
    work: Callable
    moved: Callable | None


def nothing(row, x, shift, spin):
    return np.zeros(1)


def unmoved(rest, turn, shift):
    return rest


def at_pull_point(row, x, shift, spin):
    """The part of the rigid motion at the pull point that is along the cable there."""
    d = row.along[0] @ x[row.nodes] - PULL
    return np.array([-(d / np.linalg.norm(d)) @ (shift + np.cross(spin, PULL))])


def follows(row, x, shift, spin):
    return shift + np.cross(spin, row.value(x))


def moved_point(rest, turn, shift):
    return turn.apply(rest) + shift


def follows_pose(row, x, shift, spin):
    y = row.value(x)
    return np.concatenate([shift + np.cross(spin, y[:3]), inverse_left_jacobian(y[3:]) @ spin])


def moved_pose(rest, turn, shift):
    return np.concatenate([turn.apply(rest[:3]) + shift, turn.as_rotvec()])


def cable(mesh, pull=None, radius=3.0):
    points = [attach(mesh, np.array(p), radius, "point") for p in ([3.0, 2, 5], [10, 1, 5], [18, 2, 5])]
    return make_cable(points, pull, "cable")


def cavity(kind):
    mesh = hollow(kind)
    return Case(mesh, make_cavity(mesh.X, mesh.facets[enclosed(mesh, MIDDLE)], "chamber"), nothing, unmoved)


def effector(points, mesh=MESH, orientation=False):
    row = make_effector(mesh, np.array(points, float), 2.0, 8.0, "tip", orientation)
    return Case(mesh, row, *((follows_pose, moved_pose) if orientation else (follows, moved_point)))


CONSTRAINTS = {
    "cable with pull point": Case(MESH, cable(MESH, PULL), at_pull_point, None),
    "free cable": Case(MESH, cable(MESH), nothing, unmoved),
    "point cable": Case(MESH, cable(MESH, radius=0.0), nothing, unmoved),
    "cable in hexahedra": Case(BRICKS, cable(BRICKS, PULL), at_pull_point, None),
    "cavity, tri3": cavity("tet4"),
    "cavity, tri6": cavity("tet10"),
    "cavity, quad4": cavity("hex8"),
    "contact": Case(MESH, make_contact(MESH, np.array([12.0, 0, 4]), 2.0, "patch 1"), follows, moved_point),
}
WATCHED = {
    **CONSTRAINTS,
    "effector inside": effector([19, 5, 5]),
    "effector inside hexahedra": effector([19, 5, 5], BRICKS),
    "effector carried": effector([24, 5, 5]),
    "effector carried by hexahedra": effector([24, 5, 5], BRICKS),
    "effector averaged": effector([[19, 5, 5], [18, 2, 3], [10, 5, 5]]),
    "effector averaged, part carried": effector([[19, 5, 5], [24, 2, 3]]),
    "effector with orientation": effector([19, 5, 5], orientation=True),
    "effector carried with orientation": effector([24, 5, 5], orientation=True),
    "effector averaged with orientation": effector([[19, 5, 5], [24, 2, 3]], orientation=True),
    "effector with orientation, hexahedra": effector([19, 5, 5], BRICKS, orientation=True),
}
FREE = ["free cable", "point cable", "cavity, tri3", "cavity, tri6", "cavity, quad4"]


def each(cases):
    return pytest.mark.parametrize("case", cases.values(), ids=cases.keys())


def disturbed(case, size=0.3):
    """Turned, and every node moved on its own; and a direction to differentiate in."""
    random = np.random.default_rng(0)
    return TURN.apply(case.mesh.X) + size * random.standard_normal(case.mesh.X.shape), random.standard_normal(
        case.mesh.X.shape
    )


def curvature_times(row, x, direction):
    """(n, 3), and the largest asymmetry of a batch."""
    product, asymmetry = np.zeros_like(x), 0.0
    for nodes, matrices in zip(row.cliques, row.curvature(x), strict=True):
        g, k = nodes.shape
        assert matrices.shape == (g, 3 * k, 3 * k)
        asymmetry = max(asymmetry, np.abs(matrices - matrices.swapaxes(1, 2)).max())
        part = np.einsum("gij,gj->gi", matrices, direction[nodes].reshape(g, -1)).reshape(g, k, 3)
        np.add.at(product, nodes, part)
    return product, asymmetry


@each(WATCHED)
def test_gradient_against_differences(case):
    (x, direction), h, row = disturbed(case), 1e-5, case.row
    slope = (row.value(x + h * direction) - row.value(x - h * direction)) / (2 * h)
    gradient = row.gradient(x)
    assert gradient.shape == (len(row.rest), len(row.nodes), 3)
    product = np.einsum("rkd,kd->r", gradient, direction[row.nodes])
    np.testing.assert_allclose(product, slope, rtol=1e-7, atol=1e-8)


@each(CONSTRAINTS)
def test_curvature_against_differences(case):
    (x, direction), h, row = disturbed(case), 1e-5, case.row
    difference = (row.gradient(x + h * direction) - row.gradient(x - h * direction)) / (2 * h)
    slope = np.zeros_like(x)
    slope[row.nodes] = difference.sum(axis=0)  # zero for rows without curvature
    product, asymmetry = curvature_times(row, x, direction)
    np.testing.assert_allclose(product, slope, atol=1e-7)
    assert asymmetry < 1e-14 * max(1.0, np.abs(product).max())


@each(WATCHED)
def test_rest_value(case):
    np.testing.assert_allclose(case.row.value(case.mesh.X), case.row.rest, atol=1e-11)


@each(WATCHED)
def test_virtual_work_of_a_rigid_motion(case):
    x, row = disturbed(case)[0], case.row
    shift, spin = np.array([0.3, -2.0, 1.1]), np.array([-0.7, 0.4, 1.3])
    velocity = shift + np.cross(spin, x)
    work = np.einsum("rkd,kd->r", row.gradient(x), velocity[row.nodes])
    scale = np.abs(row.gradient(x)).sum() * np.abs(velocity).max()
    np.testing.assert_allclose(work, case.work(row, x, shift, spin), atol=1e-12 * scale)


@each({name: case for name, case in WATCHED.items() if case.moved})
def test_a_rigid_motion_of_any_size(case):
    shift = np.array([3.0, -1.0, 7.0])
    expected = case.moved(case.row.rest, TURN, shift)
    np.testing.assert_allclose(case.row.value(TURN.apply(case.mesh.X) + shift), expected, atol=2e-11)


@each({name: CONSTRAINTS[name] for name in FREE})
def test_what_the_body_carries_alone_is_in_balance(case):
    """Resultant and moment are nil in any state, and so are they for the change that the curvature gives."""
    (x, direction), row = disturbed(case), case.row
    force, size = np.zeros_like(x), np.linalg.norm(x, axis=1).max()
    force[row.nodes] = row.gradient(x)[0]
    change, _ = curvature_times(row, x, direction)
    for part, moment in [(force, np.cross(x, force)), (change, np.cross(x, change) + np.cross(direction, force))]:
        assert np.abs(part.sum(axis=0)).max() < 1e-13 * np.abs(part).sum()
        assert np.abs(moment.sum(axis=0)).max() < 1e-13 * size * np.abs(part).sum()


@each({name: CONSTRAINTS[name] for name in FREE})
def test_curvature_of_a_rigid_velocity_turns_the_gradient(case):
    x, row, spin = disturbed(case)[0], case.row, np.array([-0.7, 0.4, 1.3])
    product, _ = curvature_times(row, x, np.array([1.0, 2.0, -3.0]) + np.cross(spin, x))
    expected = np.cross(spin, row.gradient(x)[0])
    np.testing.assert_allclose(product[row.nodes], expected, atol=1e-12 * np.abs(expected).max())
