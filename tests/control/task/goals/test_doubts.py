"""Trajectories that show nothing are called poor, in open and in closed loop."""

import numpy as np

from cfem.control.task.goals.doubts import left_out, one_point, wide
from cfem.control.task.goals.trajectory_spec import GoalsSpec, ImageSpec

CIRCLE = np.array([[np.cos(t), np.sin(t), 100.0] for t in np.linspace(0, 6, 24)])


def test_goals_that_are_all_one_point_are_told_by_name():
    goals = {"circle": CIRCLE, "dot": np.repeat(CIRCLE[:1], 24, axis=0), "one": CIRCLE[:1]}
    findings = [finding["what"] for finding in one_point(goals, 120.0)]
    assert findings == ["the 24 goals of 'dot' are one point: nothing is tracked"]


def test_a_goal_counts_within_a_twentieth_of_the_length():
    assert wide(6.0, 120.0, "reached") == []
    (finding,) = wide(6.1, 120.0, "loop.settle.radius")
    assert finding["what"].endswith("from 6.1 mm away, and the robot is 120 mm long: lower loop.settle.radius")


def test_images_without_a_stable_state_are_counted():
    image = ImageSpec(kind="image", centre=0.5, radii=0.3, goals=24)
    given = GoalsSpec(kind="goals", points={"mm": [[0, 0, 1]]})
    trajectories = {"circle": image, "snaps": image, "dot": given}
    (finding,) = left_out({"circle": CIRCLE, "snaps": CIRCLE[3:], "dot": CIRCLE[:1]}, trajectories)
    assert finding["what"].startswith("3 of 24 goals of 'snaps' are left out, as the robot has no stable state there")
