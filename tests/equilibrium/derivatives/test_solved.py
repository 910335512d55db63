"""Right-hand sides that are solved by the factor of a state nearby, against the factor of the state itself."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.blocks import bar

from cfem.core.errors import NumericalError
from cfem.equilibrium.condensation import refined
from cfem.equilibrium.derivatives.solved import solved
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem

EXACT = NewtonSettings(tolerance=1e-12)


def state_with_the_factor_of(robot, pulled, others):
    """The linearisation of a state that is pulled so far, with its own factor and with that of another state."""
    problem, other = Problem(robot), Problem(robot)
    here = solve(problem, actuation.displacement(pulled), settings=EXACT, wanted=Wanted(keep=True)).linear
    there = solve(other, actuation.displacement(others), settings=EXACT, wanted=Wanted(keep=True)).linear
    return here, replace(here, factor=there.factor)


def test_the_factor_of_a_state_nearby_gives_the_same_answers():
    """A correction leaves a tenth to a quarter of the residual. The rule for factors that can be replaced gives up
    there, 3 % off."""
    own, nearby = state_with_the_factor_of(bar(poisson=0.4), [1.0, 1.5], [1.05, 1.55])
    B = own.at.H
    assert refined(nearby.problem, nearby.data, nearby.factor, B)[2] > 0.01
    expected, answer = (solved(each, B) for each in (own, nearby))
    np.testing.assert_allclose(answer[0], expected[0], rtol=1e-8, atol=1e-8 * np.abs(expected[0]).max())
    assert answer[1] < 1e-10


def test_a_factor_that_is_too_far_away_is_an_error():
    own, _ = state_with_the_factor_of(bar(poisson=0.4), [1.0, 1.5], [1.05, 1.55])
    wrong = replace(own, factor=SimpleNamespace(solve=lambda B: 3 * own.factor.solve(B)))
    with pytest.raises(NumericalError, match="too far away"):
        solved(wrong, own.at.H)
