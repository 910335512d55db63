"""A robot with more actuators than coordinates to reach, whose published step is known in closed form."""

import numpy as np
import pytest

from cfem.condensed import Condensed, Rows
from cfem.control.inverse import Limits
from cfem.control.tick import Belief, Pilot, drive

ROWS = Rows(("tip.x",), ("one", "other"))
FREE = np.full((2, 2), np.inf) * [-1, 1]
CURVATURE, GOAL, RIDGE = 1.0, np.array([2.0]), np.full(2, 1e-3)


class Bowed:
    """e = d_1 - d_2^2 / 2 and lambda = delta_a. Of all states at e = g the nearest to rest is (g, 0); beside it
    d_1 grows by d_2^2 / 2."""

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        W = np.eye(3)
        W[0, 1:] = W[1:, 0] = 1.0, -CURVATURE * delta_a[1]
        e = delta_a[0] - CURVATURE * delta_a[1] ** 2 / 2
        free = np.concatenate([[e], delta_a]) - W[:, 1:] @ delta_a
        return Condensed(ROWS, W, free, np.asarray(delta_a, float))


def other_actuator(damping: float, ticks: int) -> np.ndarray:
    """Where the second actuator is believed to stand, from 1e-4 on."""
    pilot = Pilot(Bowed(), "force", "previous_step", Limits(FREE, FREE), np.ones(1), RIDGE, damping=np.full(2, damping))
    belief, at = Belief.at(pilot, np.array([2.0, 1e-4])), []
    for _ in range(ticks):
        belief = drive(pilot, belief, GOAL)
        at.append(belief.iterate.condensed.delta_a[1])
    return np.array(at)


@pytest.mark.parametrize("share", [0.0, 1.0, 10.0])
def test_damping_decides_whether_the_published_step_comes_to_rest(share):
    """The step minimises r^2 |d|^2 + s r^2 |d - now|^2 on the tangent, and goes to (s - 2) / (1 + s) of d_2: on the
    tangent d_1 changes by d_2 d(d_2), which the curvature left out would weigh."""
    at = other_actuator(np.sqrt(share) * RIDGE[0], 8)
    np.testing.assert_allclose(at[1:] / at[:-1], (share - CURVATURE * GOAL[0]) / (1 + share), rtol=1e-3)


def test_without_damping_it_jumps_between_two_states_and_with_it_rests():
    jumping, resting = other_actuator(0.0, 400), other_actuator(10 * RIDGE[0], 400)
    assert abs(jumping[-1] - jumping[-2]) > 1 and abs(resting[-1]) < 1e-6
