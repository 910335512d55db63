import re

import numpy as np
import pytest
from constraint.meshes import bricks
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.blocks import block

from cfem.condensed.rotation import inverse_left_jacobian
from cfem.constraint.carrier import make_carrier
from cfem.constraint.contact import make_contact
from cfem.constraint.effector import (
    CarriedEffector,
    CombinedEffector,
    PointEffector,
    make_effector,
)
from cfem.core.errors import SpecError

MESH = block((20, 10, 10), (4, 2, 2), order=2)
POSE = make_effector(MESH, np.array([19.0, 5, 5]), 2.0, 8.0, "tip", orientation=True)
number = st.floats(-1, 1)
axes = st.tuples(number, number, number).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)


@pytest.mark.parametrize(
    "points, orientation, kind, rows",
    [
        ([19, 5, 5], False, PointEffector, 3),
        ([24, 5, 5], False, CarriedEffector, 3),
        ([[19, 5, 5]], False, PointEffector, 3),
        ([[19, 5, 5], [18, 2, 2]], False, CombinedEffector, 3),
        ([24, 5, 5], True, CombinedEffector, 6),
    ],
)
def test_kinds_by_where_the_points_lie(points, orientation, kind, rows):
    row = make_effector(MESH, np.array(points, float), 2.0, 10.0, "tip", orientation)
    assert isinstance(row, kind)
    assert row.rest.shape == (rows,)
    np.testing.assert_allclose(row.rest[:3], np.atleast_2d(points).mean(axis=0))


def test_averaged_points_are_the_mean_of_their_effectors():
    points = np.array([[19.0, 5, 5], [24, 2, 3], [10, 5, 5]])
    x = MESH.X + 0.3 * np.random.default_rng(0).standard_normal(MESH.X.shape)
    each = [make_effector(MESH, point, 2.0, 8.0, "tip").value(x) for point in points]
    np.testing.assert_allclose(make_effector(MESH, points, 2.0, 8.0, "tip").value(x), np.mean(each, axis=0), atol=1e-13)


def test_contact_is_an_effector_with_a_force():
    point = np.array([20.0, 5, 5])
    contact, effector = make_contact(MESH, point, 2.0, "patch"), make_effector(MESH, point, 2.0, 8.0, "tip")
    np.testing.assert_array_equal(contact.gradient(MESH.X), effector.gradient(MESH.X))
    assert contact.cliques == () and len(contact.curvature(MESH.X)) == 0
    with pytest.raises(SpecError, match="contact point 'patch' at"):
        make_contact(MESH, np.array([30.0, 5, 5]), 2.0, "patch")


@given(axis=axes, angle=st.one_of(st.floats(0, 3.14), st.sampled_from([0.0, 1e-12, 1e-7, 1e-3, 0.03, 3.1415926])))
def test_orientation_up_to_half_a_turn(axis, angle):
    vector = axis / np.linalg.norm(axis) * angle
    x = Rotation.from_rotvec(vector).apply(MESH.X) + 3.0
    np.testing.assert_allclose(POSE.value(x)[3:], vector, atol=1e-13)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 0.0299, 0.0301, 1.0, 3.0, 3.14])
def test_gradient_of_the_orientation_at_any_angle(angle):
    random, h = np.random.default_rng(3), 1e-5
    x = Rotation.from_rotvec(angle * np.array([2, -1, 2]) / 3).apply(MESH.X)
    direction = random.standard_normal(x.shape)
    slope = (POSE.value(x + h * direction) - POSE.value(x - h * direction)) / (2 * h)
    product = np.einsum("rkd,kd->r", POSE.gradient(x), direction[POSE.nodes])
    np.testing.assert_allclose(product, slope, rtol=1e-7, atol=1e-8)


@given(axis=axes, angle=st.floats(0, 3.1))
def test_inverse_left_jacobian_inverts_the_integral(axis, angle):
    """J_l = integral of exp(s [phi]) over s in [0, 1], by Gauss quadrature."""
    phi = axis / np.linalg.norm(axis) * angle
    s, w = np.polynomial.legendre.leggauss(12)
    J = np.einsum("q,qij->ij", w / 2, Rotation.from_rotvec(np.outer((1 + s) / 2, phi)).as_matrix())
    np.testing.assert_allclose(inverse_left_jacobian(phi) @ J, np.eye(3), atol=1e-13)


def test_weights_of_a_region_do_not_depend_on_the_element():
    """They tend to an integral: the centre of the region and its moments are those of tetrahedra and hexahedra."""
    size, point = (20, 10, 10), np.array([[24.0, 5, 5]])
    regions = [
        make_carrier(mesh, point, 10.0, "tip") for mesh in (block(size, (32, 16, 16)), bricks(size, (32, 16, 16)))
    ]
    moments = [np.vstack([region.centre, region.weights @ region.arm**2]) for region in regions]
    np.testing.assert_allclose(moments[0], moments[1], rtol=2e-3)


def test_cells_restrict_the_region():
    left = np.flatnonzero(MESH.X[MESH.cells].mean(axis=1)[:, 0] < 10)
    row = make_effector(MESH, np.array([12.0, 5, 5]), 2.0, 8.0, "tip", orientation=True, cells=left)
    assert isinstance(row.parts[0], CarriedEffector)
    assert set(row.nodes) <= set(MESH.cells[left].ravel())


@pytest.mark.parametrize(
    "make, part",
    [
        (
            lambda: make_effector(MESH, np.array([60.0, 5, 5]), 2.0, 10.0, "tip"),
            "effector 'tip' at (60, 5, 5) mm lies outside the body and has too little of the body within 10 mm",
        ),
        (
            lambda: make_effector(MESH, np.array([19.0, 5, 5]), 2.0, 1e-3, "tip", orientation=True),
            "effector 'tip' has too little of the body within 0.001 mm",
        ),
        (
            lambda: make_carrier(bricks((20, 1e-6, 1e-6), (4, 1, 1)), np.array([[10.0, 0, 0]]), 9.0, "effector 'tip'"),
            "effector 'tip' is carried by nodes on one line",
        ),
    ],
)
def test_bad_input_is_named(make, part):
    with pytest.raises(SpecError, match=re.escape(part)):
        make()
