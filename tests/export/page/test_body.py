"""Cables and walls inside of a body move as the body does where that is affine, and lie where the scene has them."""

import numpy as np
import pytest
from export.pages import tube

from cfem.export.page.body import ActuatorTube, body, carriers, lines
from cfem.export.page.chambers import ChamberWall

SKIN = tube(100.0)
INSIDE = np.array([[0.0, 0.0, -50.0], [3.0, 1.0, -20.0], [-2.0, 4.0, -95.0]])


def test_carriers_reproduce_affine_motions():
    weights = carriers(INSIDE, SKIN["rest"])
    rng = np.random.default_rng(1)
    A, b = rng.normal(size=(3, 3)), rng.normal(size=3)
    assert np.abs(weights @ (SKIN["rest"] @ A.T + b) - (INSIDE @ A.T + b)).max() < 1e-8
    assert np.abs(weights).sum(axis=1).max() < 3  # no point hangs on large weights that cancel


def test_lines_follow_the_surface_and_what_is_held_does_not():
    line = ActuatorTube(1, np.array([[0.0, 0.0, 30.0], *INSIDE]), 0.5, held=1)
    made = body(SKIN, [line, ActuatorTube(0, INSIDE[:1], 2.0)], [])
    n = len(SKIN["rest"])
    assert made.lines == [(1, n, 4, 0.5), (0, n + 4, 1, 2.0)]
    assert (made.rest[n : n + 4] == line.points).all() and (made.modes[:, n] == 0).all()
    # the skin's modes are (z / L)^2 in x, y and z
    share = (INSIDE[:, 2] / 100) ** 2
    for axis in range(3):
        assert made.modes[axis, n + 1 : n + 4, axis] == pytest.approx(share, abs=0.02)


def test_what_a_model_says_of_its_robot_becomes_lines():
    cable = {"kind": "cable", "points": [[0, 0, -1], [0, 0, -9]], "pull_point": [0, 0, 0], "reach": [0, 1]}
    route = {"kind": "cable", "route": {"x": 5.0, "y": 15.0}, "reach": [0, 1]}
    finger = lines({"geometry": {"kind": "soft-finger"}, "actuators": [cable, route]}, 120.0)
    assert [len(one.points) for one in finger] == [3, 6] and [one.held for one in finger] == [1, 0]
    assert (finger[1].points[:, :2] == [5.0, 15.0]).all()
    side = {"kind": "cable", "route": {"side": "y+", "disks": 5}, "reach": [0, 1]}
    (cable,) = lines({"geometry": {"kind": "trunk", "length": 300.0}, "actuators": [side]}, 300.0)
    assert (len(cable.points), cable.held) == (11, 1) and (np.diff(cable.points[:, 2]) > 0).all()
    pair = {"kind": "chambers", "module": 2, "chambers": [1, 2]}
    trunk = lines({"geometry": {"kind": "stiff-flop"}, "actuators": [pair]}, 110.0)
    assert [one.actuator for one in trunk] == [0, 0]
    assert [one.points[[0, -1], 0].tolist() for one in trunk] == [[55.0, 110.0]] * 2
    assert np.linalg.norm(trunk[0].points[:, 1:], axis=1) == pytest.approx(4.0)
    assert lines({"geometry": {}, "actuators": [{"kind": "cavity", "inside": [1, 2, 3]}]}, 50.0) == []
    assert lines(None, 50.0) == []


def test_walls_of_chambers_lie_behind_the_skin_and_move_with_it_or_with_nodes_of_their_own():
    wall = ChamberWall(2, np.array([7, 5, 6]), INSIDE, np.array([[0, 1, 2], [2, 1, 0]]))
    made = body(SKIN, [ActuatorTube(0, INSIDE[:1], 2.0)], [wall])
    n, t = len(SKIN["rest"]), len(SKIN["triangles"])
    assert made.outer == t and made.chambers == [(2, t, 2)] and len(made.triangles) == t + 2
    assert (made.rest[made.triangles[t:]] == INSIDE[wall.triangles]).all()
    share = (INSIDE[:, 2] / 100) ** 2
    assert made.modes[1, n + 1 : n + 4, 1] == pytest.approx(share, abs=0.02)
    inner = {"inner_nodes": np.array([5, 6, 7]), "inner_modes": np.arange(27.0).reshape(3, 3, 3)}
    own = body(SKIN | inner, [], [wall]).modes[:, n : n + 3]
    np.testing.assert_array_equal(own, inner["inner_modes"][:, [2, 0, 1]])
