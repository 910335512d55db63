"""The battery that every constraint passes: gradient, curvature, rigid motion; and each one's own facts."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import block

from cfem.constraint.attachment import attach, locate
from cfem.constraint.cable import make_cable
from cfem.constraint.effector import CarriedEffector, PointEffector, make_effector
from cfem.core.errors import SpecError

MESH = block((20, 10, 10), (4, 2, 2), order=2)


def cable(pull=True, radius=3.0):
    points = [attach(MESH, np.array(p), radius, "point") for p in ([3.0, 2, 5], [10, 1, 5], [18, 2, 5])]
    return make_cable(points, np.array([-2.0, 3, 4]) if pull else None, "cable")


CONSTRAINTS = {
    "cable with pull point": cable(),
    "free cable": cable(pull=False),
    "point cable": cable(radius=0.0),
}
WATCHED = {
    **CONSTRAINTS,
    "effector": make_effector(MESH, np.array([19.0, 5, 5]), 2.0, 10.0, "tip"),
    "carried effector": make_effector(MESH, np.array([24.0, 5, 5]), 2.0, 10.0, "tip"),
}


def moved(seed=0, size=0.5):
    turn = Rotation.from_rotvec([0.3, -0.5, 0.2]).as_matrix()
    return MESH.X @ turn.T + size * np.random.default_rng(seed).standard_normal(MESH.X.shape)


@pytest.mark.parametrize("row", WATCHED.values(), ids=WATCHED.keys())
def test_gradient_against_differences(row):
    x, h = moved(), 1e-5
    direction = np.random.default_rng(1).standard_normal(x.shape)
    slope = (row.value(x + h * direction) - row.value(x - h * direction)) / (2 * h)
    np.testing.assert_allclose(
        np.einsum("rkd,kd->r", row.gradient(x), direction[row.nodes]), slope, rtol=1e-7, atol=1e-8
    )


@pytest.mark.parametrize("row", CONSTRAINTS.values(), ids=CONSTRAINTS.keys())
def test_curvature_against_differences(row):
    x, h = moved(), 1e-5
    direction = np.random.default_rng(1).standard_normal(x.shape)
    slope = np.zeros_like(x)
    slope[row.nodes] = (row.gradient(x + h * direction) - row.gradient(x - h * direction))[0] / (2 * h)
    product = np.zeros_like(x)
    for nodes, matrix in zip(row.cliques, row.curvature(x), strict=True):
        product[nodes] += (matrix @ direction[nodes].ravel()).reshape(-1, 3)
    np.testing.assert_allclose(product, slope, atol=1e-7)


@pytest.mark.parametrize("row", WATCHED.values(), ids=WATCHED.keys())
def test_rest_value(row):
    np.testing.assert_allclose(row.value(MESH.X), row.rest, atol=1e-12)


@pytest.mark.parametrize("name", ["effector", "carried effector"])
def test_effector_follows_a_rigid_motion_exactly(name):
    turn, shift = Rotation.from_rotvec([1.0, -2.0, 0.5]).as_matrix(), np.array([3.0, -1.0, 7.0])
    np.testing.assert_allclose(
        WATCHED[name].value(MESH.X @ turn.T + shift), turn @ WATCHED[name].rest + shift, atol=1e-11
    )


def test_free_cable_pulls_without_resultant_or_moment():
    x = moved()
    row = CONSTRAINTS["free cable"]
    force = row.gradient(x)[0]
    assert np.abs(force.sum(axis=0)).max() < 1e-13
    assert np.abs(np.cross(x[row.nodes], force).sum(axis=0)).max() < 1e-11


def test_cable_shortening_of_a_stretched_body():
    points = [attach(MESH, np.array(p), 2.0, "point") for p in ([2.0, 5, 5], [18.0, 5, 5])]
    row = make_cable(points, None, "cable")
    assert row.value(MESH.X * [0.9, 1, 1])[0] == pytest.approx(1.6, abs=1e-12)


@pytest.mark.parametrize("point", [[5.0, 5, 5], [5.0, 0, 5], [20.0, 10, 10], [0.3, 0.2, 9.9]])
@pytest.mark.parametrize("radius", [0.0, 1.5, 3.0])
def test_attachment_follows_every_affine_motion(point, radius):
    """Inside, on a face, in a corner: weights sum to one and have their first moment at the point."""
    where = attach(MESH, np.array(point), radius, "point")
    F = np.random.default_rng(0).standard_normal((3, 3))
    np.testing.assert_allclose(where.position(MESH.X @ F.T + 1.0), F @ point + 1.0, atol=1e-11)
    assert where.weights.sum() == pytest.approx(1.0, abs=1e-12)


def test_locate_finds_the_cell_that_holds_a_point():
    points = np.random.default_rng(0).uniform([0, 0, 0], [20, 10, 10], (50, 3))
    cells, barycentric = locate(MESH, points, within=1e-12)
    assert (cells >= 0).all()
    np.testing.assert_allclose(np.einsum("ka,kad->kd", barycentric, MESH.X[MESH.cells[cells, :4]]), points, atol=1e-12)
    assert locate(MESH, np.array([[30.0, 5, 5]]), within=1e-9)[0][0] == -1


def test_kinds_of_effector_by_where_the_point_lies():
    assert isinstance(WATCHED["effector"], PointEffector)
    assert isinstance(WATCHED["carried effector"], CarriedEffector)


@pytest.mark.parametrize(
    "make, part",
    [
        (
            lambda: attach(MESH, np.array([25.0, 5, 5]), 2.0, "cable 'left' point 1"),
            "cable 'left' point 1 at (25, 5, 5) mm lies outside",
        ),
        (lambda: make_cable([WATCHED["effector"].attachment] * 2, None, "left"), "points 1 and 2 coincide"),
        (lambda: make_cable([WATCHED["effector"].attachment], None, "left"), "needs two points"),
        (lambda: make_effector(MESH, np.array([60.0, 5, 5]), 2.0, 10.0, "tip"), "no part of it within 10 mm"),
    ],
)
def test_bad_input_is_named(make, part):
    with pytest.raises(SpecError, match=__import__("re").escape(part)):
        make()
