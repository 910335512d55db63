"""The compiled loops of touched patches say what the formulas say, written out in array operations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cfem.predict.contact.compliance import load_response, moved_places, patch_compliance
from cfem.predict.contact.patched_model import turn_cubic
from cfem.predict.loads.high_order import beyond, slope


@pytest.fixture(scope="module")
def drawn():
    """A body of 6 patches, 4 modes, 2 effectors and 5 terms, with symmetric series."""
    rng = np.random.default_rng(0)
    local = rng.normal(size=(6, 6, 5, 3, 3))
    local = local + local.transpose(1, 0, 2, 4, 3)
    C = rng.normal(size=(4, 4))
    R = Rotation.random(3, rng=rng).as_matrix()
    chosen, at = np.array([1, 2, 5]), rng.normal(size=5)
    modes, dented = rng.normal(size=(6, 3, 4)), rng.normal(size=(5, 6, 3, 3, 5))
    return chosen, modes, C @ C.T, R, at, local, dented


def test_parts_of_chosen_patches(drawn):
    chosen, modes, C, R, at, local, dented = drawn
    U, left, total, dents = patch_compliance(*drawn)
    L = np.tensordot(at, local[chosen[:, None], chosen], axes=(0, 2))
    turned = (R[:, None] @ L @ R[None].swapaxes(-1, -2)).swapaxes(1, 2).reshape(9, 9)
    np.testing.assert_allclose(left, turned, atol=1e-12)
    np.testing.assert_allclose(total, turned + U @ C @ U.T, atol=1e-12)
    np.testing.assert_array_equal(U, modes[chosen].reshape(9, 4))
    np.testing.assert_allclose(dents, turn_cubic(np.tensordot(at, dented[:, chosen], axes=1), R), atol=1e-12)


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
