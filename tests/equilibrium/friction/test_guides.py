"""Cables that rub in their guides: hysteresis around the frictionless shape, and no energy to learn."""

from dataclasses import replace

import numpy as np
import pytest
from support.rods import rod_problem

from cfem.constraint.rod_cable import make_rod_cable
from cfem.core.errors import SpecError
from cfem.equilibrium.friction.guides import slipping, solve_slipping
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Status

POINTS = np.array([[0, 0, 0.6], [100, 0, 0.6]])


@pytest.fixture(scope="module")
def rods():
    """Without friction, and with."""
    free = rod_problem(10, lambda body: [make_rod_cable(body.rod, POINTS, "c")])
    cable = replace(free.robot.actuators[0], friction=0.4)
    return free, Problem(replace(free.robot, actuators=(cable,)), like=free)


def height(found):
    assert found.status is Status.CONVERGED
    return found.delta_e[2]


def test_loading_bends_less_and_unloading_more(rods):
    free, rubbing = rods
    lam = force(np.array([0.05]))
    without = height(solve(free, lam, wanted=Wanted(condense=False)))
    loading, shares = solve_slipping(rubbing, lam)
    unloading, _ = solve_slipping(rubbing, lam, ways=-1.0)
    assert height(loading) < without < height(unloading)
    np.testing.assert_allclose(shares[0], slipping(rubbing.robot.actuators[0], loading.state.x, 1.0), atol=1e-6)


def test_moment_along_the_rod_is_the_tension_that_is_left(rods):
    """EI kappa = T(s) r on every element: the rod's own law, not the cable's."""
    _, rubbing = rods
    found, _ = solve_slipping(rubbing, force(np.array([0.05])))
    e = rubbing.body.rod and rubbing.evaluate(found.state.x, np.empty(0)).response.rod.strain.e
    turned = np.cumsum(np.abs(e[:, 4])) - np.abs(e[:, 4]) / 2
    bending = rubbing.body.rod.stiffness[0, 4]
    np.testing.assert_allclose(bending * np.abs(e[:, 4]) / 10, 0.6 * 0.05 * np.exp(-0.4 * turned), rtol=5e-3)


def test_no_condensed_energy_with_friction(rods):
    with pytest.raises(SpecError, match="friction"):
        solve(rods[1], force(np.array([0.05])))


def test_shares_of_a_robot_without_friction_start_one_with(rods):
    free, rubbing = rods
    _, shares = solve_slipping(free, force(np.array([0.05])))
    found, _ = solve_slipping(rubbing, force(np.array([0.05])), shares=shares)
    assert found.status is Status.CONVERGED
