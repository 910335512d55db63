"""The page of a crawler, of results made up."""

import numpy as np
import pytest

from cfem.report.sections.gait import distances, gait_section, gait_summary
from cfem.report.sections.tracking import Tracking

RESULTS = {
    "per_cycle": {"planned": 6.0, "half_steps": 6.1, "fe": 5.9},
    "distance": {"planned": 12.0, "half_steps": None, "fe": 11.9},
    "frictions": [{"friction": 0.9, "planned": 4.0, "fe": None, "status": "no"}],
    "planned_frictions": [{"friction": 0.3, "planned": 8.0, "status": "converged"}],
}
UNITS = {"left": ("mm", "N")}


def walked(distance=None):
    """Two cycles of two commands along x; the plan begins at x = 5 mm."""
    goal = np.array([[5.0 + 3 * i, 0.0, 0.0] for i in range(1, 5)])
    columns = {
        "trajectory": np.array(["gait"] * 4),
        "controller": np.array(["spectral"] * 4),
        "goal_index": np.arange(4),
        "goal": goal,
        "predicted_e": goal - [5.0, 0.0, 0.0],
        "x_e": goal - [0.05, 0.0, 0.0],
        "error": np.full(4, 0.05),
        "lambda_a": np.ones((4, 2)),
        "step_us": np.full(4, 1e5),
    }
    spec = {"reached": 0.5, "gait": {"direction": [2.0, 0.0, 0.0], "ground": {"friction": 0.6}, "distance": distance}}
    rows = ["base.x", "base.y", "base.z", "front.left", "rear.left"]
    return Tracking(columns, rows, {"gait": {"spectral": {}}}, spec, "fem", 635, None, headline=("gait: good",))


def test_the_page_says_how_far_it_goes_by_plan_and_by_finite_elements():
    said = gait_summary(walked(), RESULTS)
    assert said.sentence == "The crawler goes 5.9 mm a cycle by finite elements, 6 mm a cycle by the plan."
    assert [one.value for one in said.numbers] == ["5.9 mm a cycle", "50 µm", "100 ms"]
    assert said.numbers[0].notes == ("6 mm a cycle planned", "6.1 mm a cycle planned in half steps")
    far = gait_summary(walked(11.0), RESULTS).numbers[0]
    assert far.notes[1] == "the plan does not come to its end in half steps"
    assert "11.9 mm by finite elements" in gait_summary(walked(11.0), RESULTS).sentence


def test_a_walk_that_ended_says_so():
    ended = RESULTS | {"per_cycle": {"planned": 6.0, "half_steps": 6.1, "fe": None}}
    assert "do not finish" in gait_summary(walked(), ended).sentence


def test_distances_are_in_order_of_friction_and_walks_that_ended_are_told_apart():
    assert [one["friction"] for one in distances(walked(), RESULTS)] == [0.3, 0.6, 0.9]
    table = gait_section(walked(), RESULTS, UNITS).parts[0]
    assert table.rows == [("0.6", "6", "5.9"), ("0.9", "4", "no whole cycle")]


@pytest.mark.parametrize("more", [{}, {"frictions": [], "planned_frictions": []}])
def test_the_way_is_drawn(more):
    section = gait_section(walked(), RESULTS | more, UNITS)
    way = next(part for part in section.parts if getattr(part, "name", "") == "gait")
    assert len(way.panels) == (2 if more else 3) and "plan" in way.legend
