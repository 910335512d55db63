import numpy as np
import pytest

from cfem.report.forces_figure import forces_figure
from cfem.report.loop_figure import loop_figure
from cfem.report.robot_figure import robot_figure
from cfem.report.tracking_figure import effort_figure, tracking_figure

PNG = b"\x89PNG\r\n\x1a\n"


def rows(errors):
    goals = np.array([[0.0, 10.0 * i, -120 + i * i] for i in range(4)])
    names = ["fe-based"] * 4 + ["spectral"] * 4
    return {
        "controller": np.array(names),
        "goal_index": np.tile(np.arange(4), 2),
        "goal": np.vstack([goals, goals]),
        "x_e": np.vstack([goals, goals + 0.1]),
        "error": np.array(errors),
        "error_to_fe_based": np.array(errors),
    }


@pytest.mark.parametrize("error", [0.0, 0.1, np.nan])
def test_tracking_draws_exact_failed_and_ordinary_results(error):
    assert tracking_figure(rows([error] * 8), "t").startswith(PNG)


@pytest.mark.parametrize("robots", [0, 1, 2])
def test_forces_are_drawn_with_and_without_an_object(robots):
    carried = {"lambda_a": np.full((8, 2), 0.03)} | ({"contact": np.ones((8, 3 * robots))} if robots else {})
    assert forces_figure(rows([0.1] * 8) | carried, ["a.left", "b.left"], "t").startswith(PNG)


@pytest.mark.parametrize("error", [0.0, 0.1, np.nan])
def test_a_loop_is_drawn_whatever_its_errors(error):
    over_time = {"seed": np.zeros(8, int), "seconds": np.tile(np.arange(4) / 90, 2)}
    assert loop_figure(rows([error] * 8) | over_time, "t").startswith(PNG)


def test_effort_draws_trajectories_with_and_without_reachable_goals():
    spread = {"mean": 0.1, "max": 0.2}
    base = {"goals": 4, "iterations_mean": 2.0, "step_us": {"median": 100.0, "p99": 200.0}}
    near = {**base, "reachable": 4, "distance_to_reachable_goals": spread, "distance_to_fe_based": spread}
    far = {**base, "reachable": 0, "distance_to_reachable_goals": None, "distance_to_fe_based": spread}
    itself = {**far, "distance_to_fe_based": None}
    summaries = {"a": {"fe-based": near, "s": near, "s@1": near}, "b": {"fe-based": itself, "s": far, "s@1": far}}
    assert effort_figure(summaries).startswith(PNG)


def test_the_same_robot_makes_the_same_picture():
    X = np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
    facets = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    states = np.stack([X + np.array([0, 2.0, 0]), X + np.array([0, 4.0, 1.0])])
    goals = states[:, 3]
    first, second = (robot_figure(X, facets, states, goals, goals, "t") for _ in range(2))
    assert first == second and first.startswith(PNG)
