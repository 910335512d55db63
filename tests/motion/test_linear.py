"""Linearised steps against the steps themselves."""

from dataclasses import replace

import numpy as np
import pytest
from motion.learned import model

from cfem.condensed.viscosity import Viscosity
from cfem.motion.altered import Altered
from cfem.motion.linear import Guess, MaterialShares, linear_steps, places
from cfem.motion.step import MotionCommand, at_rest, step

DT = 2e-3
KINDS = ["force", "displacement"]


def with_prony(prony):
    made = model()
    if prony:
        losses, made = (Viscosity(1e-3, ((0.3, 5e-3), (0.2, 2e-2))),), Altered(made)
        made = type("Relaxing", (Altered,), {"losses": property(lambda self: losses)})(made.model)
    return made


def flat(motion):
    return np.concatenate([motion.q, motion.p, motion.memory.ravel()])


def moving(which, kind, amount):
    """A motion some steps after a command that differs from rest by a share `amount`, and the next command."""
    motion = at_rest(which, [1.5])
    u = motion.lam if kind == "force" else motion.q[:1]
    for k in range(5):
        motion = step(which, motion, MotionCommand(**{kind: u * (1 + amount * np.sin(k))}), DT, tolerance=1e-9)
    return motion, u * (1 + amount)


def after(which, motion, kind, z, u):
    n_q = which.n_q
    start = replace(motion, q=z[:n_q], p=z[n_q : 2 * n_q], memory=z[2 * n_q :].reshape(-1, n_q))
    return step(which, start, MotionCommand(**{kind: u}), DT, tolerance=1e-9)


def linearised(which, motion, kind, u, v):
    z = flat(motion)
    place = places(which, (z[:1] + DT / 2 * v[:1])[None])
    return linear_steps(place, which.losses, Guess(z[None], v[None], u[None]), kind, DT)


def near(found, expected, share):
    np.testing.assert_allclose(found, expected, atol=share * np.abs(expected).max())


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("prony", [False, True])
def test_repeated_it_is_newton_s_method(kind, prony):
    which = with_prony(prony)
    motion, u = moving(which, kind, 0.2)
    expected, v = step(which, motion, MotionCommand(**{kind: u}), DT, tolerance=1e-9), motion.v
    for _ in range(8):
        found = linearised(which, motion, kind, u, v)
        v = (found.end[0, : which.n_q] - motion.q) / DT
    size = np.abs(flat(expected)) + 1e-6
    np.testing.assert_allclose(found.end[0] / size, flat(expected) / size, atol=1e-6)
    if kind == "displacement":
        np.testing.assert_allclose(found.lam[0], expected.lam, rtol=1e-8)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("prony", [False, True])
def test_slopes_are_those_of_the_step(kind, prony):
    """Exact at rest; what is left out grows with the speed."""
    which = with_prony(prony)
    for amount, allowed in ((0.0, 1e-4), (0.05, 2e-2)):
        motion, u = moving(which, kind, amount)
        expected = step(which, motion, MotionCommand(**{kind: u}), DT, tolerance=1e-9)
        found = linearised(which, motion, kind, u, expected.v)
        z, n_q = flat(motion), which.n_q
        size = np.tile(which.scale, len(z) // n_q)  # of q; momenta: M v of that size
        size[n_q : 2 * n_q] = 1 / (which.scale * 200.0)
        h = 1e-2
        for j in range(len(z)):
            dz = h * size[j] * np.eye(len(z))[j]
            ends = [flat(after(which, motion, kind, z + s * dz, u)) for s in (1, -1)]
            slope = (ends[0] - ends[1]) / (2 * h)
            near(found.A[0][:, j] * size[j] / size, slope / size, allowed)
        du = 1e-4 * np.abs(u)
        ends = [flat(after(which, motion, kind, z, u + s * du)) for s in (1, -1)]
        slope = (ends[0] - ends[1]) / 2
        near(found.B[0] @ du / size, slope / size, allowed)


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_by_the_material_are_those_of_altered_models(kind):
    motion, u = moving(model(), kind, 0.1)
    expected = step(model(), motion, MotionCommand(**{kind: u}), DT, tolerance=1e-9)
    found, h = linearised(model(), motion, kind, u, expected.v).by_material[0], 1e-4
    for column, change in enumerate(({"stiffness": 1 + h}, {"viscosity": 1 + h})):
        other = flat(after(Altered(model(), **change), motion, kind, flat(motion), u))
        slope = (other - flat(expected)) / h
        np.testing.assert_allclose(found[:, column], slope, atol=3e-2 * np.abs(slope).max())


def test_a_material_is_that_of_the_altered_model(monkeypatch):
    monkeypatch.setattr("cfem.motion.step.NEAR", 1e-10)  # both to the last digit
    motion, u = moving(model(), "force", 0.2)
    expected = step(Altered(model(), 1.3, 0.7), motion, MotionCommand(force=u), DT, tolerance=1e-9)
    v = motion.v
    for _ in range(8):
        place = places(model(), (motion.q[:1] + DT / 2 * v[:1])[None])
        guess = Guess(flat(motion)[None], v[None], u[None])
        found = linear_steps(place, model().losses, guess, "force", DT, MaterialShares(1.3, 0.7))
        v = (found.end[0, : model().n_q] - motion.q) / DT
    np.testing.assert_allclose(found.end[0, : model().n_q], expected.q, rtol=1e-6, atol=1e-9)


def test_places_between_knots_are_near_those_asked():
    delta = np.linspace(1.0, 1.4, 9)[:, None]
    every, some = places(model(), delta), places(model(), delta, 4)
    np.testing.assert_array_equal(every.pull, some.pull)
    for k in (0, 4, 8):
        np.testing.assert_allclose(some.M[k], every.M[k], rtol=1e-12)
    middle = (3 * every.M[4] + every.M[8]) / 4
    np.testing.assert_allclose(some.M[5], middle, rtol=1e-12, atol=1e-12 * np.abs(middle).max())
    size = np.sqrt(np.einsum("kii,kjj->kij", every.M, every.M))
    assert np.abs((some.M - every.M) / size).max() < 3e-2


def test_the_last_knot_is_the_last_place_however_many_there_are():
    delta = np.linspace(1.0, 1.4, 6)[:, None]
    every, some = places(model(), delta), places(model(), delta, 4)
    np.testing.assert_allclose(some.M[[0, 4, 5]], every.M[[0, 4, 5]], rtol=1e-12)
    np.testing.assert_allclose(some.M[1], (3 * every.M[0] + every.M[4]) / 4, rtol=1e-12, atol=1e-12)
