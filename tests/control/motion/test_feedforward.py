"""Feed-forward and shaping of the bar's commands."""

from collections import deque
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from control.motion.bar import DT, clocked, errors, pilot, plant, robot, standing, static, swing
from support.fast_cases import fast_are

from cfem.control.motion.feedforward import Computed, Shaped
from cfem.motion.modes import natural_modes
from cfem.motion.step import MotionCommand, at_rest, step


@pytest.mark.parametrize("kind", fast_are({"displacement"}, ["force", "displacement"]))
def test_computed_forces_follow_faster_than_the_static_inverse(kind):
    start = standing(2.4 if kind == "force" else 1.5, kind)
    begin = 2.4 if kind == "force" else 1.5
    goals = swing(16.6, 90, kind)
    computed = Computed(pilot(kind), robot(), robot().rest_e, start.delta_a, DT)
    ahead, _ = errors(computed, plant(begin, kind), goals, kind)
    behind, _ = errors(static(start, kind), plant(begin, kind), goals, kind)
    assert ahead[40:].mean() < 0.65 * behind[40:].mean()


@pytest.mark.parametrize("kind", ["zv", "zvd"])
@pytest.mark.parametrize("known", [True, False])
def test_a_shaped_step_leaves_no_vibration_in_its_mode(kind, known):
    """Whether it is known ahead or not."""
    start, rest = standing(2.0), clocked().at_rest(standing(2.6)).z[: robot().n_q]
    mode = natural_modes(robot(), standing(2.6).delta_a, False, 1).shapes[:, 0]
    place = robot().at(standing(2.6).delta_a)
    end = robot().rest_e + standing(2.6).delta_e
    still = robot().rest_e + start.delta_e
    goals = np.concatenate([np.repeat(still[None], 15, axis=0), np.repeat(end[None], 60, axis=0)])
    left = {}
    for name in ("plain", "shaped"):
        controller = static(start)
        if name == "shaped":
            controller = Shaped(controller, robot(), False, kind, 1, DT)
        body, found = plant(2.0), []
        for k, goal in enumerate(goals):
            body.step(controller.tick(goal, None, goals[k:] if known else None).u, "force")
            found.append(mode @ place.M @ (body._plants[0]._motion.q - rest))
        left[name] = np.abs(found[30:45]).max()
    assert left["shaped"] < 0.2 * left["plain"]


def test_commands_keep_bounds():
    start, goals = standing(2.4), swing(16.6, 40)
    computed = Computed(pilot(highest=2.6), robot(), robot().rest_e, start.delta_a, DT)
    _, u = errors(computed, plant(2.4), goals)
    assert u.max() == pytest.approx(2.6)


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_at_a_goal_that_stays_it_commands_what_holds_the_robot_there(kind):
    """Nothing is excited: the static command, and what it aims at is the goal."""
    start = standing(2.4 if kind == "force" else 1.5, kind)
    computed = Computed(pilot(kind), robot(), robot().rest_e, start.delta_a, DT)
    np.testing.assert_allclose(computed.aimed, robot().rest_e + start.delta_e)
    held = start.lambda_a if kind == "force" else start.delta_a
    np.testing.assert_allclose(computed.belief.u, held)
    goal = robot().rest_e + start.delta_e
    for _ in range(6):
        belief = computed.tick(goal)
        np.testing.assert_allclose(belief.u, held, rtol=1e-4)
        np.testing.assert_array_equal(computed.aimed, goal)
    np.testing.assert_allclose(belief.delta_a, start.delta_a, rtol=1e-4)


def test_inner_motions_and_forces_of_a_slow_motion_are_those_of_the_robot():
    """Against steps of the dynamics with the actuator held on a slow swing, far below the first frequency."""
    start, t = standing(1.5, "displacement"), DT * np.arange(400)
    course = 1.5 + 0.3 * np.sin(2 * np.pi * 2.0 * t) * np.minimum(t / 0.3, 1.0)
    computed = Computed(pilot("displacement"), robot(), robot().rest_e, start.delta_a, DT)
    now, swings, forces, expected = at_rest(robot(), np.array([1.5])), [], [], []
    for k in range(1, 399):
        now = step(robot(), now, MotionCommand(displacement=course[[k]]), DT)
        swings.append(now.q[1:])
        forces.append(now.lam)
        expected.append(computed._excited(deque(course[k - 1 : k + 2, None])))
    late = slice(200, None)
    eta, lam = (np.array([one[place] for one in expected]) for place in (0, 1))
    travel = np.ptp(eta[late], axis=0).max()
    assert np.abs(np.array(swings)[late] - eta[late]).max() < 0.1 * travel
    # forces of the model's steps act in their middle
    middle = (lam[1:] + lam[:-1])[late] / 2
    assert np.abs(np.array(forces)[1:][late] - middle).max() < 2e-3 * np.ptp(lam[late])


@pytest.mark.parametrize("acceleration", [0.0, 5e3])
def test_what_moves_with_a_changing_inertia_is_pushed_by_the_equations_of_lagrange(acceleration):
    """d/dt (M v) - v M' v / 2 of the actuator, with M' by differences of the inertia."""
    model, h, speed = robot(), 1e-4, 40.0
    start = standing(1.5, "displacement")
    computed = Computed(pilot("displacement"), model, model.rest_e, start.delta_a, DT)
    bend = acceleration * DT**2 / 2
    planned = deque(np.array([1.5 - DT * speed + bend, 1.5, 1.5 + DT * speed + bend])[:, None])
    inertia = [model.at(np.array([1.5 + side * h])).M[0, 0] for side in (-1, 1)]
    place = model.at(np.array([1.5]))
    expected = place.pull + computed._lost(place)[0, 0] * speed + np.diff(inertia) / (2 * h) * speed**2 / 2
    expected = expected + place.M[0, 0] * acceleration
    by_inertia = np.abs(np.diff(inertia) / (2 * h) * speed**2 / 2)
    np.testing.assert_allclose(computed._excited(planned)[1], expected, rtol=0, atol=1e-3 * by_inertia[0])


def test_a_command_changes_by_its_rate_at_most():
    start, goals = standing(2.4), swing(16.6, 30)
    computed = Computed(replace(pilot(), rate=0.05), robot(), robot().rest_e, start.delta_a, DT)
    u = np.array([start.lambda_a, *(computed.tick(goal, None, goals[k:]).u for k, goal in enumerate(goals))])
    assert np.abs(np.diff(u, axis=0)).max() == pytest.approx(0.05)


def test_slow_motion_is_resisted_by_each_loss_for_as_long_as_it_lasts():
    """A relaxation, and terms of Prony's series of shares g and times tau: sum of g tau."""
    losses = [
        SimpleNamespace(relaxation=0.01, prony=[(0.2, 0.5), (0.1, 3.0)]),
        SimpleNamespace(relaxation=0.2, prony=[]),
    ]
    F = np.stack([np.eye(2), np.array([[2.0, 1.0], [1.0, 2.0]])])
    computed = SimpleNamespace(_model=SimpleNamespace(losses=losses))
    lost = Computed._lost(computed, SimpleNamespace(F=F, M=np.zeros((2, 2))))
    np.testing.assert_allclose(lost, 0.41 * F[0] + 0.2 * F[1])
    computed._model.losses = []
    np.testing.assert_array_equal(Computed._lost(computed, SimpleNamespace(F=F, M=np.ones((2, 2)))), np.zeros((2, 2)))
