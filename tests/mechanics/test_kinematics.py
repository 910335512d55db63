"""Rigid groups: kinematics against finite differences, and against a part so stiff that it might as well be rigid."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import box_body

from cfem.mechanics.assembly import make_pattern, symmetric_product
from cfem.mechanics.body import response, tangent, tangent_form, without
from cfem.mechanics.kinematics import make_kinematics


def parts(element="tet10p0"):
    """A box of which both ends are rigid, one end and one node held."""
    body = box_body((3, 1, 1), (3, 1, 1), element)
    X = body.mesh.X
    groups = [np.flatnonzero(X[:, 0] > 1.9), np.flatnonzero((X[:, 0] < 1.1) & (X[:, 0] > 0.9))]
    owner = np.full(len(X), -1)
    for number, nodes in enumerate(groups):
        owner[nodes] = number
    soft = without(body, owner)
    fixed = np.flatnonzero(X[:, 0] < 1e-9)
    return soft, make_kinematics(X, [soft.cells], fixed, groups)


def moved(kinematics, seed=0, size=0.1):
    q = size * np.random.default_rng(seed).standard_normal(kinematics.n_dof)
    return kinematics.move(kinematics.X, q)


def test_only_cells_that_deform_are_left():
    body, kinematics = parts()
    assert len(body.cells) == 12  # two of three cubes, six tetrahedra each
    assert kinematics.n_dof < kinematics.full.n_dof


def test_spread_is_the_derivative_of_move_and_reduce_its_transpose():
    _, kinematics = parts()
    x, rng = moved(kinematics), np.random.default_rng(1)
    q, f, h = rng.standard_normal(kinematics.n_dof), rng.standard_normal(kinematics.X.shape), 1e-5
    slope = (kinematics.move(x, h * q) - kinematics.move(x, -h * q)) / (2 * h)
    np.testing.assert_allclose(kinematics.spread(x, q), slope, atol=1e-8)
    assert (kinematics.reduce(x, f) @ q) == pytest.approx((f * kinematics.spread(x, q)).sum(), rel=1e-12)
    many = np.stack([f, 2 * f], axis=-1)
    np.testing.assert_allclose(kinematics.reduce(x, many)[:, 1], 2 * kinematics.reduce(x, f))


def test_rigid_groups_stay_rigid_and_hold_restores_them():
    _, kinematics = parts()
    x = moved(kinematics, size=0.3)
    for nodes in np.split(kinematics.groups.nodes, kinematics.groups.start[1:]):
        apart = np.linalg.norm(x[nodes] - x[nodes[0]], axis=1)
        at_rest = np.linalg.norm(kinematics.X[nodes] - kinematics.X[nodes[0]], axis=1)
        np.testing.assert_allclose(apart, at_rest, atol=1e-14)
    np.testing.assert_allclose(kinematics.hold(x), x, atol=1e-14)
    bent = kinematics.hold(x + 0.01 * np.random.default_rng(2).standard_normal(x.shape))
    np.testing.assert_allclose(kinematics.hold(bent), bent, atol=1e-14)
    np.testing.assert_array_equal(bent[kinematics.fixed], kinematics.X[kinematics.fixed])


@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8"])
def test_stiffness_is_the_second_derivative_of_the_energy(element):
    """Off equilibrium as well, where the moment of the unbalanced forces counts."""
    body, kinematics = parts(element)
    x = moved(kinematics, size=0.05)
    data = np.zeros(kinematics.full.nnz)
    at = response(body, x)
    tangent(body, at, kinematics.full.slots, data)
    reduced = kinematics.stiffness(x, data, at.force)
    q = np.random.default_rng(3).standard_normal(kinematics.n_dof)
    h = 2e-3

    def energy(k):
        return response(body, kinematics.move(x, k * h * q)).energy

    second = (-energy(2) + 16 * energy(1) - 30 * energy(0) + 16 * energy(-1) - energy(-2)) / (12 * h * h)
    ours = q @ symmetric_product(kinematics.pattern, reduced, q[:, None])[:, 0]
    assert ours == pytest.approx(second, rel=1e-6)
    motions = np.stack([kinematics.spread(x, q)], axis=-1)
    form = tangent_form(body, at, motions) + kinematics.turning_form(x, q[:, None], at.force)
    assert form[0, 0] == pytest.approx(ours, rel=1e-12)


def test_without_groups_nothing_is_added():
    body = box_body((2, 1, 1), (2, 1, 1))
    kinematics = make_kinematics(body.mesh.X, [body.cells], np.array([0]))
    assert kinematics.pattern is kinematics.full
    assert kinematics.pattern.nnz == make_pattern(len(body.mesh.X), [body.cells], np.array([0])).nnz


def test_a_turned_rest_shape_is_found_again():
    _, kinematics = parts()
    turn = Rotation.from_rotvec([0.3, 2.0, -0.5])
    nodes = kinematics.groups.nodes[kinematics.groups.owner == 0]
    x = kinematics.X.copy()
    x[nodes] = turn.apply(x[nodes]) + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(kinematics.hold(x)[nodes], x[nodes], atol=1e-13)


def test_only_the_nodes_that_count_are_asked():
    """Forces on some nodes of a rigid end, and the motion of these."""
    _, kinematics = parts()
    x, rng = kinematics.X, np.random.default_rng(0)
    some = np.zeros(len(x), dtype=bool)
    some[kinematics.groups.nodes[kinematics.groups.owner == 0][1::2]] = True
    q, nodal = rng.normal(size=(kinematics.n_dof, 4)), rng.normal(size=(len(x), 3, 4)) * some[:, None, None]
    np.testing.assert_allclose(kinematics.spread(x, q, some)[some], kinematics.spread(x, q)[some])
    np.testing.assert_allclose(kinematics.reduce(x, nodal, some), kinematics.reduce(x, nodal), atol=1e-12)
