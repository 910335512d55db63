"""Cables that go slack, against every set of slack cables of a linear robot."""

from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.predict.contact.step.slack import with_slack


class Robot:
    """Cables that pull with K (delta - shift) N; a cubic term makes them stiffer, `bend` of it."""

    def __init__(self, K, shift, bend=0.0, fails_at=None):
        self.K, self.shift, self.bend, self.fails_at, self.steps = K, shift, bend, fails_at, 0
        self.rows = SimpleNamespace(n_a=len(K))
        self.reach = np.array([[-5.0, 5.0]] * len(K))

    def pull(self, delta):
        way = delta - self.shift
        return self.K @ way + self.bend * way**3

    def step(self, delta):
        self.steps += 1
        return SimpleNamespace(delta=delta, pull=self.pull(delta), converged=self.steps != self.fails_at)

    def at_displacement(self, delta):
        return SimpleNamespace(W=np.linalg.inv(self.K), rows=SimpleNamespace(a=slice(0, len(self.K))))


def enumerated(robot, target, unilateral):
    """(delta, slack) of all sets whose slack cables carry nothing and are beyond their targets."""
    found = []
    for chosen in product([False, True], repeat=len(target)):
        slack = np.array(chosen)
        if (slack & ~unilateral).any():
            continue
        delta = target.copy()
        if slack.any():
            K, held = robot.K, ~slack
            right = -K[np.ix_(slack, held)] @ (target - robot.shift)[held]
            delta[slack] = robot.shift[slack] + np.linalg.solve(K[np.ix_(slack, slack)], right)
        pull = robot.pull(delta)
        if (pull[unilateral & ~slack] >= -1e-12).all() and (delta[slack] >= target[slack] - 1e-12).all():
            found.append((delta, slack))
    return found


@pytest.mark.parametrize("seed", range(12))
def test_the_state_is_the_one_that_every_cable_agrees_with(seed):
    rng = np.random.default_rng(seed)
    root, n = rng.normal(size=(4, 4)), 4
    robot = Robot(root @ root.T + np.eye(n), rng.normal(size=n))
    target, unilateral = rng.normal(size=n), np.array([True, True, True, seed % 2 == 0])
    state, slack, settled = with_slack(robot.step, [robot], unilateral, target, None)
    ((delta, expected),) = enumerated(robot, target, unilateral)  # a positive definite robot has one
    assert settled and state.converged
    np.testing.assert_array_equal(slack, expected)
    np.testing.assert_allclose(state.delta, delta, atol=1e-8)


def test_a_step_after_it_begins_with_the_cables_that_were_slack():
    robot = Robot(np.array([[2.0, 0.9], [0.9, 1.5]]), np.array([0.5, 1.0]))
    target, both = np.array([2.0, 0.0]), np.array([True, True])
    state, slack, _ = with_slack(robot.step, [robot], both, target, None)
    first = robot.steps
    assert slack.tolist() == [False, True]
    given = state.delta, np.where(slack, 0.0, state.pull)
    again, still, _ = with_slack(robot.step, [robot], both, target, given)
    assert still.tolist() == [False, True] and robot.steps - first == 1
    np.testing.assert_allclose(again.delta, state.delta, atol=1e-9)
    tight, held, settled = with_slack(robot.step, [robot], both, np.array([2.0, 3.0]), given)
    assert settled and not held.any()
    np.testing.assert_allclose(tight.delta, [2.0, 3.0])


def test_cables_that_may_push_are_left_alone():
    robot = Robot(np.eye(2), np.ones(2))
    state, slack, settled = with_slack(robot.step, [robot], np.zeros(2, dtype=bool), np.zeros(2), None)
    assert settled and not slack.any() and robot.steps == 1 and (state.pull < 0).all()


def test_a_robot_that_is_not_linear_settles_and_one_without_a_state_says_so():
    robot = Robot(np.eye(2), np.array([1.5, -1.0]), bend=2.0)
    state, slack, settled = with_slack(robot.step, [robot], np.array([True, True]), np.zeros(2), None)
    assert settled and slack.tolist() == [True, False]
    assert abs(state.pull[0]) < 1e-8 and state.delta[0] == pytest.approx(1.5, abs=1e-8)
    lost = Robot(np.eye(2), np.array([1.5, -1.0]), fails_at=2)
    state, _, _ = with_slack(lost.step, [lost], np.array([True, True]), np.zeros(2), None)
    assert not state.converged and lost.steps == 2


def test_robots_are_taken_one_after_the_other():
    one, other = Robot(np.array([[2.0]]), np.array([1.0])), Robot(np.array([[3.0]]), np.array([-1.0]))

    def step(delta):
        pull = np.concatenate([one.pull(delta[:1]), other.pull(delta[1:])])
        return SimpleNamespace(delta=delta, pull=pull, converged=True)

    state, slack, settled = with_slack(step, [one, other], np.array([True, True]), np.zeros(2), None)
    assert settled and slack.tolist() == [True, False]
    np.testing.assert_allclose(state.delta, [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(state.pull, [0.0, 3.0], atol=1e-7)
