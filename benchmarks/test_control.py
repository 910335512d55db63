"""Costs of the control step, as ratios within one run: machines differ, ratios hold."""

import numpy as np
import pytest
from support.arc_robot import LENGTH, REACH, ArcRobot, tip

from cfem.condensed.strokes import ridge_of
from cfem.control.search.goal_search import Iterate, SearchSettings, search_goal
from cfem.control.search.inverse import Aim, Limits, inverse_step

NOW = ArcRobot().at_displacement(np.array([6.0, 5.0]))
AIM = Aim(tip(np.array([6.4, 5.4])), np.ones(3), ridge_of(1e-10, REACH, LENGTH))
LIMITS = Limits.of(REACH, np.array([True, True]))


@pytest.mark.parametrize("backend", ["active_set", "osqp"])
@pytest.mark.benchmark(group="inverse step")
def test_inverse_step(benchmark, backend):
    step = benchmark(inverse_step, NOW, AIM, LIMITS, backend=backend)
    assert step.qp.kkt.missed < 1e-9


@pytest.mark.parametrize("iterations", [1, 2, 20])
@pytest.mark.benchmark(group="goal")
def test_goal(benchmark, iterations):
    model = ArcRobot()
    found = benchmark(search_goal, model, AIM, LIMITS, Iterate.at(NOW), SearchSettings(iterations=iterations))
    assert found.distance < 0.1
