"""Feed-forward and shaping of the bar's commands."""

import numpy as np
import pytest
from control.motion.bar import DT, clocked, errors, pilot, plant, robot, standing, static, swing

from cfem.control.motion.feedforward import Computed, Shaped
from cfem.motion.modes import natural_modes


@pytest.mark.parametrize("kind", ["force", "displacement"])
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
