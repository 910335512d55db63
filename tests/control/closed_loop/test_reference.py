"""References of a loop: which goals, and when the next one is due."""

import numpy as np
import pytest

from cfem.control.closed_loop.reference import references_of
from cfem.control.closed_loop.spec import LoopSpec

CIRCLE = np.column_stack([np.cos(np.arange(8) * np.pi / 4), np.sin(np.arange(8) * np.pi / 4)])
SETTLE = {"radius": "0.5 mm", "hold": "0.3 s", "at_most": "4 s"}
LOOP = {"rate": "20 Hz", "settle": SETTLE, "command": {"kind": "displacement"}, "controllers": {"a": {"mode": "open"}}}


def loop(**more):
    return LoopSpec.model_validate(LOOP | more)


def test_goals_wait_until_the_last_is_reached():
    (reference,) = references_of({"circle": CIRCLE}, loop())
    pace = reference.pace
    assert reference.name == "circle" and reference.goals is CIRCLE
    assert (pace.radius, pace.hold, pace.ticks_a_goal, pace.at_most, pace.run_up) == (0.5, 6, None, 80, 0)


def test_goals_come_at_their_times():
    pace = references_of({"circle": CIRCLE}, loop(goal_every="0.2 s", approach="2 s", budget="30 s"))[0].pace
    assert (pace.ticks_a_goal, pace.approach, pace.budget) == (4, 40, 600)


@pytest.mark.parametrize(("speed", "run_up"), [(0.5, 0), (1.0, 10)])
def test_laps_have_a_goal_at_each_tick(speed, run_up):
    laps = {"speeds": [f"{speed} Hz"], "laps": 2, "run_up": f"{run_up / 20} s"}
    (reference,) = references_of({"circle": CIRCLE}, loop(laps=laps))
    pace = reference.pace
    assert reference.name == f"circle at {speed:g} Hz"
    assert (pace.radius, pace.hold, pace.ticks_a_goal, pace.run_up) == (0.5, 1, 1, run_up)
    assert len(reference.goals) == run_up + round(2 * 20 / speed)
