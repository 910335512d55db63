"""Chord corrections: what those before foretell, against a linear system and on a trunk."""

import numpy as np
import pytest
from support.blocks import bar

from cfem.equilibrium import newton as module
from cfem.equilibrium.newton import Correction, accelerated
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem


def linear(step):
    return Correction(step, 2.0 * step[:2], -step[:1], np.zeros(1, dtype=bool))


@pytest.mark.parametrize("rank", [1, 2, 3])
def test_a_factor_that_is_wrong_in_few_directions_converges_in_one_step_more_than_these(rank):
    rng = np.random.default_rng(rank)
    A = (
        np.eye(9)
        + 0.8 * (wrong := np.linalg.qr(rng.normal(size=(9, rank)))[0]) @ np.diag(0.5 + 0.5 * rng.random(rank)) @ wrong.T
    )
    b, x, taken = rng.normal(size=9), np.zeros(9), []
    proposed = linear(b - A @ x)  # by the factor of the identity
    plain = proposed.step
    for _ in range(rank + 1):
        correction = accelerated(proposed, taken)
        x, plain = x + correction.step, plain + (b - A @ plain)
        following = linear(b - A @ x)
        taken.append((correction, following.less(1.0, proposed)))
        proposed = following
    correction = accelerated(proposed, taken)
    np.testing.assert_allclose(x + correction.step, np.linalg.solve(A, b), atol=1e-12)
    np.testing.assert_allclose(correction.pressure, 2.0 * correction.step[:2], atol=1e-12)
    np.testing.assert_allclose(correction.multipliers, -correction.step[:1], atol=1e-12)
    assert np.abs(plain - np.linalg.solve(A, b)).max() > 1e-6


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_passed_on_and_raise_nothing(bad):
    good, proposed = linear(np.arange(1.0, 4.0)), linear(np.array([bad, 1.0, 2.0]))
    assert accelerated(proposed, [(good, good)]) is proposed
    assert accelerated(good, [(good, proposed)]) is good


def test_nothing_taken_nothing_foretold():
    proposed = linear(np.arange(3.0))
    assert accelerated(proposed, []) is proposed


def test_the_same_state_with_fewer_corrections_than_by_the_chord_alone(monkeypatch):
    asked = displacement([6.0, 0.0])
    helped = solve(Problem(bar("tet10", divisions=(8, 1, 1))), asked, slack=False)
    monkeypatch.setattr(module, "accelerated", lambda proposed, _: proposed)
    alone = solve(Problem(bar("tet10", divisions=(8, 1, 1))), asked, slack=False)
    np.testing.assert_allclose(helped.state.x, alone.state.x, atol=1e-7)
    assert helped.iterations <= alone.iterations and helped.factorizations <= alone.factorizations
