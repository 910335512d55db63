"""What is asked of a robot at obstacles, in numbers that can be counted by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.condensed import Rows
from cfem.control.closed_loop.tick import Pilot
from cfem.control.search.inverse import Limits
from cfem.control.task.obstacles.world import PRESSED, ObstacleWorld, world_of

ROWS = Rows(("tip.x", "tip.y", "tip.z", "pad.force", "stop.force", "wall.distance"), ("cable",))
PAD = SimpleNamespace(press=2.0, largest_force=3.0, avoid=None)
STOP = SimpleNamespace(press=None, largest_force=0.5, avoid=None)
WALL = SimpleNamespace(press=None, largest_force=None, avoid=4.0)
SPEC = SimpleNamespace(obstacles={"pad": PAD, "stop": STOP, "wall": WALL})


@pytest.fixture(scope="module")
def world():
    obstacles = SimpleNamespace(pressed=("pad", "stop"), avoided=("wall",))
    return world_of(SPEC, obstacles, SimpleNamespace(rows=ROWS, stiffness=0.25))


def test_forces_weigh_as_the_way_that_they_bend_the_robot(world):
    np.testing.assert_allclose(world.goal, [2.0, 0.0, 0.0])
    np.testing.assert_allclose(world.weights, [4.0, 0.0, 0.0])
    np.testing.assert_allclose(world.bounds, [[-np.inf, 3.0], [-np.inf, 0.5], [4.0, np.inf]])


def test_goals_and_rest_have_the_rows_of_obstacles(world):
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    np.testing.assert_allclose(world.goals(points), [[1, 2, 3, 2, 0, 0], [4, 5, 6, 2, 0, 0]])
    np.testing.assert_allclose(world.rest(points[0]), [1, 2, 3, 0, 0, 0])


def test_the_pilot_is_bounded_at_obstacles_alone_and_only_places_are_places(world):
    limits = Limits(np.array([[0.0, np.inf]]), np.array([[0.0, 8.0]]))
    pilot = Pilot(None, "displacement", "equilibrium", limits, np.array([1.0, 1.0, 0.5]), np.zeros(1))
    given = world.pilot(pilot)
    np.testing.assert_allclose(given.weights, [1, 1, 0.5, 4, 0, 0])
    np.testing.assert_array_equal(given.places, [True] * 3 + [False] * 3)
    assert not np.isfinite(given.limits.delta_e[:3]).any()
    np.testing.assert_allclose(given.limits.delta_e[3:], world.bounds)
    assert given.limits.delta_a is limits.delta_a
    masked = world.pilot(replace(pilot, places=np.array([True, False, True])))
    np.testing.assert_array_equal(masked.places, [True, False, True] + [False] * 3)


@pytest.mark.parametrize(
    ("force", "other", "distance", "met"),
    [
        (2.0, 0.0, 4.0, True),
        (2.0 * (1 + 0.99 * PRESSED), 0.5, 9.0, True),
        (2.0 * (1 + 1.01 * PRESSED), 0.0, 4.0, False),
        (2.0 * (1 - 1.01 * PRESSED), 0.0, 4.0, False),
        (2.0, 0.5 * (1 + 0.99 * PRESSED), 4.0, True),
        (2.0, 0.5 * (1 + 1.01 * PRESSED), 4.0, False),
        (2.0, 0.0, 3.91, True),  # within what counts as reached
        (2.0, 0.0, 3.89, False),
    ],
)
def test_a_goal_is_met_where_forces_and_distances_are_as_asked(world, force, other, distance, met):
    assert world.met(np.array([9.0, 9.0, 9.0, force, other, distance]), 0.1) == met


def test_results_say_what_was_pressed_and_how_near_it_came(world):
    rows = np.array([[2.0, 0.1, 5.0], [2.05, 0.4, 4.5], [2.3, 0.2, 6.0]])
    records = [{"x_e": np.concatenate([np.zeros(3), row])} for row in rows]
    figures, lines = world.results(SPEC, records)
    pad = figures["pad"]
    assert (pad["least"], pad["largest"], pad["unit"], pad["wanted"]) == (2.0, 2.3, "N", 2.0)
    assert pad["error_mean"] == pytest.approx(0.35 / 3) and pad["error_max"] == pytest.approx(0.3)
    assert figures["stop"] == {"least": 0.1, "largest": 0.4, "unit": "N"}
    assert figures["wall"] == {"least": 4.5, "largest": 6.0, "unit": "mm", "wanted": 4.0}
    assert "held at 2 of 3 goals" in lines[0] and lines[0].endswith("at most 3 N allowed")
    assert lines[1] == "stop: pressed with 0.1 to 0.4 N; at most 0.5 N allowed"
    assert lines[2] == "wall: the robot came within 4.5 mm, 4 mm wanted"
    assert isinstance(world, ObstacleWorld)
