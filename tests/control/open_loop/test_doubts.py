"""A tracking result with forces that the mesh does not know is called poor."""

import numpy as np
import pytest

from cfem.control.open_loop.doubts import doubts

CIRCLE = np.array([[np.cos(t), np.sin(t), 100.0] for t in np.linspace(0, 6, 24)])


def said(goals, refined, near=0.1):
    return [one["what"] for one in doubts(goals, near, refined, 120.0)]


@pytest.mark.parametrize("key", ["force_percent", "travel_percent"])
@pytest.mark.parametrize("percent, poor", [(36.0, True), (20.1, True), (19.9, False), (float("nan"), True)])
def test_forces_or_travels_that_the_mesh_leaves_uncertain_are_poor(key, percent, poor):
    assert bool(said({"circle": CIRCLE}, {key: percent, "cells": 560})) == poor


def test_what_the_mesh_leaves_uncertain_is_named():
    refined = {"force_percent": 36.0, "travel_percent": 25.0, "cells": 560}
    what = "36 % of the actuator forces and 25 % of the effectors' travel"
    assert said({"circle": CIRCLE}, refined) == [f"the mesh of 560 cells leaves {what} uncertain: use a finer mesh"]


def test_a_mesh_that_is_too_coarse_for_an_estimate_is_poor():
    refined = {"left_out": "90 cells are too few", "apart_percent": 17.0}
    assert said({"circle": CIRCLE}, refined) == ["90 cells are too few: use a finer mesh"]
    assert said({"circle": CIRCLE}, {"left_out": "mesh_error is null in the spec"}) == []


def test_a_goal_that_is_reached_from_far_away_is_poor():
    known = {"force_percent": 1.0, "cells": 560}
    assert said({"circle": CIRCLE}, known, near=6.0) == []
    found = said({"circle": CIRCLE}, known, near=500.0)
    assert found == ["a goal counts as reached from 500 mm away, and the robot is 120 mm long: lower reached"]
