"""Nodes that dent a surface together: the derivatives of one energy, whatever the forces."""

from itertools import permutations

import numpy as np
import pytest

from cfem.predict.contact.forces.joint_dents import changed, dent_slopes, dented_places
from cfem.predict.contact.surface.surface_model import JointDents

TRIPLES = np.array([[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 2], [1, 1, 1], [2, 2, 2]])
ALL, NONE = np.ones(3, dtype=bool), np.zeros(0)


def slopes_of(dented):
    return dent_slopes(dented.change, dented.mine, dented.factor)


@pytest.fixture(scope="module")
def drawn():
    """Compliance C (9, 9) and D (9, 9, 9) of three nodes, and the dents that say so."""
    rng = np.random.default_rng(3)
    D, A = np.zeros((3, 3, 3, 3, 3, 3)), rng.normal(size=(9, 9))
    change = 0.2 * rng.normal(size=(len(TRIPLES), 3, 3, 3))
    for number, triple in enumerate(TRIPLES):
        orders = [order for order in permutations(range(3)) if np.array_equal(triple[list(order)], triple)]
        change[number] = sum(change[number].transpose(order) for order in orders) / len(orders)
        for order in permutations(range(3)):
            i, j, k = triple[list(order)]
            D[i, :, j, :, k] = change[number].transpose(order)
    return A @ A.T + 3 * np.eye(9), D.reshape(9, 9, 9), JointDents(TRIPLES, change)


def test_each_triple_tells_the_change_of_all_its_pairs(drawn):
    _, D, dents = drawn
    f = np.random.default_rng(4).normal(size=9)
    np.testing.assert_allclose(changed(f, *dents), D @ f, atol=1e-13)
    for unit, by_unit in zip(np.eye(9), D.transpose(2, 0, 1), strict=True):  # forces along one axis of one node
        np.testing.assert_allclose(changed(unit, *dents), by_unit, atol=1e-13)


@pytest.mark.parametrize("size", [1e-3, 0.5])
def test_places_are_those_at_which_the_energy_makes_the_forces(drawn, size):
    """u -> u . K u / 2 - D[K u, K u, K u] / 6, differentiated by u, is the force that was asked for."""
    C, D, dents = drawn
    forces, K = size * np.random.default_rng(5).normal(size=(3, 3)), np.linalg.inv(C)
    dented = dented_places(forces, C, *dents, ALL, NONE)
    assert dented.share == 1.0
    u, step = C @ forces.ravel() + dented.places.ravel(), 1e-5

    def energy(u):
        g = K @ u
        return u @ g / 2 - np.einsum("ijk,i,j,k", D, g, g, g) / 6

    by_energy = [(energy(u + step * unit) - energy(u - step * unit)) / (2 * step) for unit in np.eye(9)]
    np.testing.assert_allclose(by_energy, forces.ravel(), rtol=1e-6, atol=1e-9 * size)
    assert dented.energy == pytest.approx(energy(u) - forces.ravel() @ C @ forces.ravel() / 2, abs=1e-12)


@pytest.mark.parametrize("pressed", [ALL, np.array([True, False, True]), ~ALL])
def test_slopes_and_the_stored_energy_go_with_the_places(drawn, pressed):
    C, _, dents = drawn
    forces, step = 0.5 * np.random.default_rng(5).normal(size=(3, 3)), 1e-6
    places, stored = [], []
    for unit in np.eye(9).reshape(9, 3, 3):
        ahead, behind = (dented_places(forces + way * unit, C, *dents, pressed, NONE) for way in (step, -step))
        places.append(((ahead.places - behind.places) / (2 * step)).ravel())
        stored.append((ahead.energy - behind.energy) / (2 * step))
    dented = dented_places(forces, C, *dents, pressed, NONE)
    np.testing.assert_allclose(slopes_of(dented), np.column_stack(places), atol=1e-7 * np.abs(slopes_of(dented)).max())
    np.testing.assert_array_equal(slopes_of(dented), slopes_of(dented).T)
    np.testing.assert_allclose(stored, forces.ravel() @ slopes_of(dented), atol=1e-7)


@pytest.mark.parametrize("axis", range(3))
def test_a_node_that_does_not_give_way_dents_others_by_a_force_along_any_axis(drawn, axis):
    """No force along the other axes is the limit of small ones."""
    C, _, dents = drawn
    forces, pressed = np.zeros((3, 3)), np.array([True, False, False])
    forces[0] = 0.05
    alone = dented_places(forces, C, *dents, pressed, NONE)
    forces[1, axis] = 1.0
    one = dented_places(forces, C, *dents, pressed, NONE)
    forces[1] += 1e-13
    several = dented_places(forces, C, *dents, pressed, NONE)
    assert np.abs(one.h - alone.h).max() > 0.01 * np.abs(one.h).max()
    np.testing.assert_allclose(one.h, several.h, rtol=1e-9)
    np.testing.assert_allclose(one.places, several.places, rtol=1e-9)


def test_one_factorisation_a_step_of_nodes_that_bear_forces(drawn):
    C, _, dents = drawn
    forces = np.zeros((3, 3))
    forces[0] = 0.05
    dented = dented_places(forces, C, *dents, np.array([True, False, False]), NONE)
    assert slopes_of(dented).any() and dented.systems == 2 and dented.factor.shape == (3, 3)


def test_from_near_it_takes_fewer_and_ends_there(drawn):
    C, _, dents = drawn
    forces = 0.5 * np.random.default_rng(5).normal(size=(3, 3))
    near, alone = (dented_places(share * forces, C, *dents, ALL, NONE) for share in (0.999, 1.0))
    dented = dented_places(forces, C, *dents, ALL, near.h)
    np.testing.assert_allclose(dented.places, alone.places, rtol=1e-13, atol=1e-15)
    assert dented.systems < alone.systems
    dented = dented_places(forces, C, *dents, ALL, near.h + 100.0)  # where it is not stable
    np.testing.assert_allclose(dented.places, alone.places, rtol=1e-13, atol=1e-15)
    assert dented.share == 1.0


def test_of_a_surface_that_would_carry_no_more_a_part_is_taken_and_said(drawn):
    C, _, _ = drawn
    forces = np.zeros((3, 3))
    forces[0] = 50.0
    dented = dented_places(forces, C, np.zeros((1, 3), dtype=int), np.ones((1, 3, 3, 3)), ALL, NONE)
    assert dented.share < 1.0 and np.isfinite(dented.places).all()
    assert np.linalg.eigvalsh(C + slopes_of(dented)).min() > 0
