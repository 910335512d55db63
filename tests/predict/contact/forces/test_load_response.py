"""What forces on patches do is what the formulas say, written out in array operations."""

from itertools import permutations

import numpy as np
import pytest
from support.patches import drawn_patches

from cfem.predict.contact.forces.high_order import beyond, slope
from cfem.predict.contact.forces.load_response import load_response, moved_places, under_forces
from cfem.predict.contact.surface.patch_compliance import patch_compliance


@pytest.fixture(scope="module")
def drawn():
    return drawn_patches()


@pytest.mark.parametrize("size", [1e-3, 0.3, 3.0])  # to the second order, and beyond it, where some soften
def test_what_forces_do(drawn, size):
    _, _, C, *_ = drawn
    rng = np.random.default_rng(1)
    forces, D = size * rng.normal(size=(3, 3)), rng.normal(size=(3, 5, 3))
    bends = np.linalg.qr(rng.normal(size=(4, 3)))[0]
    U, _, _, dented = patch_compliance(*drawn)
    flexibility = np.array([0.5, 1.0, 2.0])
    of = load_response(forces, C, bends, D, U, flexibility, dented)
    w = forces.ravel() @ U
    change = np.tensordot(w @ bends, D, axes=1)
    modes = beyond(w, C @ w, bends @ change[2:] @ bends.T @ w)
    for one, other in zip(of.modes, modes, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(of.change, change, atol=1e-12)
    np.testing.assert_allclose(of.v, w @ bends, atol=1e-12)
    for i, f in enumerate(forces):
        bent, own, stiff = dented[i, ..., :3] @ f, flexibility[i] * f, flexibility[i] * np.eye(3)
        dent = beyond(f, own, bent @ f)
        np.testing.assert_allclose(of.places[i], dent.motion - own, rtol=1e-10, atol=1e-12)
        np.testing.assert_allclose(of.slopes[i], slope(dent, stiff, bent) - stiff, rtol=1e-10, atol=1e-12)
        assert of.seconds[i] == pytest.approx(dent.second, rel=1e-10)


def test_places_are_moved_by_modes_and_locally(drawn):
    rng, (chosen, modes, *_) = np.random.default_rng(2), drawn
    free, motion, dents, forces = (rng.normal(size=size) for size in ((6, 3), 4, (3, 3), (3, 3)))
    local = patch_compliance(*drawn)[1]
    expected = free + modes @ motion
    expected[chosen] += (local @ forces.ravel()).reshape(3, 3) + dents
    places = moved_places(free, modes.reshape(18, 4), motion, chosen, local, forces, dents)
    np.testing.assert_allclose(places, expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("size", [0.3, 3.0])
def test_the_compliance_under_forces_is_the_change_of_the_places_with_them(drawn, size):
    """By differences of what forces do, where rows' compliance and dents change as those of an energy."""
    _, _, C, *_ = drawn
    rng, h = np.random.default_rng(1), 1e-6
    forces, D = size * rng.normal(size=(3, 3)), rng.normal(size=(3, 5, 3))
    D[:, 2:] = sum(D[:, 2:].transpose(order) for order in permutations(range(3))) / 6
    bends = np.linalg.qr(rng.normal(size=(4, 3)))[0]
    U, local, _, dented = patch_compliance(*drawn)
    own = dented[..., :3]
    own[:] = sum(own.transpose(0, *order) for order in permutations((1, 2, 3))) / 6
    flexibility = np.array([0.5, 1.0, 2.0])
    total = local + U @ C @ U.T

    def response(f):
        return load_response(f.reshape(3, 3), C, bends, D, U, flexibility, dented)

    def moved(f):
        of = response(f)
        return local @ f + U @ of.modes.motion + of.places.ravel()

    of, f = response(forces.ravel()), forces.ravel()
    found = under_forces(total, local, U, bends, of.change[2:], of.slopes, of.modes)
    by_differences = np.array([(moved(f + step) - moved(f - step)) / (2 * h) for step in h * np.eye(9)]).T
    np.testing.assert_allclose(found, by_differences, atol=1e-6 * np.abs(found).max())
