"""A bar that is pulled against obstacles: touching, sticking, sliding, and letting go."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.obstacle_step import obstacle_step

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Box, Capsule, Plane, Sphere
from cfem.contact.step_status import StepStatus
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem

REST = np.array([30.0, 5.0, 9.0])  # of the bar's contact point, which the cables lift
UPSIDE_DOWN = np.diag([1.0, -1.0, -1.0])


@pytest.fixture(scope="module")
def problem():
    return Problem(bar(element="tet4", cables=2, contact=True))


def lift(share):
    """Pulls the upper cable."""
    return displacement(np.array([-share, share]))


def ceiling(height):
    """Half space above z = height."""
    return Plane(R=UPSIDE_DOWN, t=np.array([0.0, 0.0, height]))


def test_out_of_reach_of_the_obstacle_nothing_happens(problem):
    free = solve(problem, lift(1.0))
    found = obstacle_step(problem, lift(1.0), [ceiling(1e3)], mu=0.5)
    assert found.converged and found.modes == (Mode.OPEN,)
    np.testing.assert_allclose(found.solved[0].delta_c, free.delta_c, atol=1e-9)
    assert np.abs(found.solved[0].lambda_c).max() < 1e-10


@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_a_ceiling_stops_the_point_and_pushes_it_down(problem, mu):
    rises = solve(problem, lift(1.0)).delta_c[2]
    assert rises > 0.1
    height = REST[2] + 0.5 * rises
    found = obstacle_step(problem, lift(1.0), [ceiling(height)], "coulomb" if mu else "signorini", mu)
    assert found.converged and found.check.largest < 1e-8
    assert found.solved[0].delta_c[2] == pytest.approx(0.5 * rises, abs=1e-8)
    push = found.solved[0].lambda_c
    assert push[2] < 0
    # Nothing else than the multipliers holds the point: the same forces, given, lead to the same state
    again = solve(problem, _with_contact(problem, lift(1.0), push), base=found.solved[0].state)
    np.testing.assert_allclose(again.delta_c, found.solved[0].delta_c, atol=1e-7)
    assert np.linalg.norm(push[:2]) <= (mu * (1 + 1e-9) + 1e-9) * -push[2]  # relative: solves leave 1e-10


def test_a_held_point_sticks_until_friction_is_used_up_and_then_slides(problem):
    mu, height = 0.3, REST[2] + 0.3
    at = obstacle_step(problem, lift(1.0), [ceiling(height)], mu=mu)
    assert at.converged
    # the robot slid on its way here; the ceiling moves so that friction first lets go, then turns round
    pushed = at.solved[0].lambda_c * [1, 1, 0]
    drag, seen, slip = -0.01 * pushed / np.linalg.norm(pushed), [], 0.0
    for _ in range(20):
        before = at
        at = obstacle_step(problem, lift(1.0), [ceiling(height)], mu=mu, before=before, carried=before.stuck + drag)
        assert at.converged, at.status
        normal, tangential = -at.solved[0].lambda_c[2], np.linalg.norm(at.solved[0].lambda_c[:2])
        assert tangential <= mu * normal * (1 + 1e-7)
        seen.append(at.modes[0])
        if at.modes[0] is Mode.SLIP:
            assert tangential == pytest.approx(mu * normal, rel=1e-7)
            slip += np.linalg.norm(at.stuck - before.stuck - drag)
    assert seen[-1] is Mode.SLIP and slip > 0
    assert Mode.STICK in seen, seen


def test_it_lets_go_when_the_robot_retreats(problem):
    at = obstacle_step(problem, lift(1.0), [ceiling(REST[2] + 0.3)], mu=0.3)
    assert at.modes[0] is not Mode.OPEN
    back = obstacle_step(problem, lift(0.0), [ceiling(REST[2] + 0.3)], mu=0.3, before=at)
    assert back.converged and back.modes == (Mode.OPEN,)
    assert np.abs(back.solved[0].delta_c).max() < 1e-7


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(20.0, t=REST + [2.0, 1.0, 20.3]),
        Capsule(15.0, 30.0, t=REST + [0.5, 1.0, 15.3 + 30.0]),
        Box(np.array([4.0, 4.0, 4.0]), t=REST + [0.2, 0.1, 4.3]),
    ],
    ids=["sphere", "capsule", "box"],
)
@pytest.mark.parametrize("law, mu", [("signorini", 0.0), ("coulomb", 0.4)])
def test_any_obstacle(problem, shape, law, mu):
    found = obstacle_step(problem, lift(1.0), [shape], law, mu)
    assert found.converged and found.modes[0] is not Mode.OPEN
    at = REST + found.solved[0].delta_c
    assert shape.distance(at[None])[0] == pytest.approx(0.0, abs=1e-8)
    normal = shape.normals(at[None])[0]
    pushed = found.solved[0].lambda_c
    assert pushed @ normal > 0
    assert np.linalg.norm(pushed - (pushed @ normal) * normal) <= mu * (pushed @ normal) * (1 + 1e-7) + 1e-9


def test_a_moving_obstacle_pushes_the_robot(problem):
    sphere = Sphere(10.0, t=REST + [0.0, 0.0, 10.5])
    heights = []
    at = None
    for depth in (0.0, 0.5, 1.0, 1.5):
        moved = replace(sphere, t=sphere.t - [0.0, 0.0, depth])
        at = obstacle_step(problem, force(np.zeros(2)), [moved], "signorini", before=at)
        assert at.converged
        heights.append(at.solved[0].delta_c[2])
    assert heights[0] == pytest.approx(0.0, abs=1e-9) and heights[-1] == pytest.approx(-1.0, abs=0.05)


def test_what_has_no_equilibrium_says_so(problem):
    found = obstacle_step(problem, lift(np.nan), [ceiling(1e3)])
    assert found.status is StepStatus.NO_EQUILIBRIUM and not found.converged


def _with_contact(problem, actuators, lam_c):
    padded = actuators.padded(problem.n_active)
    return replace(padded, offset=np.concatenate([padded.offset[: actuators.n], lam_c]))
