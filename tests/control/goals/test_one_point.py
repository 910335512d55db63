"""A trajectory whose goals are all one point is called poor by name, in open and in closed loop."""

import numpy as np

from cfem.control.goals.one_point import one_point

CIRCLE = np.array([[np.cos(t), np.sin(t), 100.0] for t in np.linspace(0, 6, 24)])


def test_goals_that_are_all_one_point_are_told_by_name():
    goals = {"circle": CIRCLE, "dot": np.repeat(CIRCLE[:1], 24, axis=0), "one": CIRCLE[:1]}
    findings = [finding["what"] for finding in one_point(goals, 120.0)]
    assert findings == ["the 24 goals of 'dot' are one point: nothing is tracked"]
