"""Equilibrium of a body that touches itself: energy, forces, W and dW belong together, and legs do not pass."""

import numpy as np
import pytest
from support.clip import GAP, clip
from support.fast_cases import fast_are

from cfem.constraint.surface import triangulated
from cfem.contact.surface.overlap import boundary_of
from cfem.equilibrium.derived import Wanted
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem

EXACT = NewtonSettings(tolerance=1e-12)
CLOSED = np.array([2.0, 0.4])  # mm of both cables: more than the gap between the legs


@pytest.fixture(scope="module", params=["tet4", "tet10", "tet10p0"])
def touching(request):
    problem = Problem(clip(request.param))
    state = solve(problem, actuation.displacement(CLOSED), settings=EXACT, wanted=Wanted(third_order=True))
    assert state.converged and len(problem.evaluate(state.state.x, state.state.pressure).response.contact.pairs) > 50
    return problem, state


def along(problem, state, h, k):
    """States whose cable k pulls h N more, and h N less."""
    lam = state.state.lam
    both = [solve(problem, actuation.force(lam + s * h * np.eye(2)[k]), state.state, None, EXACT) for s in (1, -1)]
    assert all(each.converged for each in both)
    return both


@pytest.mark.parametrize("k", fast_are({1}, [0, 1]))
def test_compliance_and_its_slope_are_those_of_solves_with_other_forces(touching, k):
    problem, state = touching
    h = 1e-3 * np.abs(state.state.lam[k])
    more, less = along(problem, state, h, k)
    W = state.condensed.W
    moved = np.concatenate([more.delta_e - less.delta_e, more.delta - less.delta]) / (2 * h)
    np.testing.assert_allclose(W[:, 3 + k], moved, rtol=0, atol=1e-4 * np.abs(W).max())
    changed = (more.condensed.W - less.condensed.W) / (2 * h)
    np.testing.assert_allclose(state.dW[k], changed, rtol=0, atol=2e-3 * np.abs(changed).max())


@pytest.mark.parametrize("k", [0, 1])
def test_forces_are_the_slope_of_the_energy(touching, k):
    problem, state = touching
    h = 1e-3
    more, less = (
        solve(problem, actuation.displacement(CLOSED + s * h * np.eye(2)[k]), state.state, None, EXACT) for s in (1, -1)
    )
    assert (more.energy - less.energy) / (2 * h) == pytest.approx(state.state.lam[k], 1e-5)


def test_legs_pass_through_each_other_only_where_nothing_is_said_of_contact():
    depths = []
    for said in (True, False):
        robot = clip("tet10", self_contact=said)
        state = solve(Problem(robot), actuation.displacement(CLOSED))
        assert state.converged
        depths.append(boundary_of(robot.X, triangulated(robot.facets)).overlap(state.state.x).depth)
    assert depths[0] < 0.1 * GAP and depths[1] > 0.3 * GAP


def test_steps_that_stop_where_walls_meet_close_the_legs_in_half_the_factorisations():
    """16, where the first step puts the legs through each other."""
    state = solve(Problem(clip("tet4")), actuation.displacement(CLOSED))
    assert state.converged and state.steps == 1 and state.factorizations <= 9
