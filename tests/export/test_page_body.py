"""Cables and chambers inside of a body move as the body does where that is affine, and lie where the scene has them."""

import numpy as np
import pytest
from export.pages import tube

from cfem.export.page_body import Line, body, carriers, lines, sharpened

SKIN = tube(100.0)
INSIDE = np.array([[0.0, 0.0, -50.0], [3.0, 1.0, -20.0], [-2.0, 4.0, -95.0]])


def test_carriers_reproduce_affine_motions():
    weights = carriers(INSIDE, SKIN["rest"])
    rng = np.random.default_rng(1)
    A, b = rng.normal(size=(3, 3)), rng.normal(size=3)
    assert np.abs(weights @ (SKIN["rest"] @ A.T + b) - (INSIDE @ A.T + b)).max() < 1e-8
    assert np.abs(weights).sum(axis=1).max() < 3  # no point hangs on large weights that cancel


def test_lines_follow_the_surface_and_what_is_held_does_not():
    line = Line(1, np.array([[0.0, 0.0, 30.0], *INSIDE]), 0.5, held=1)
    made = body(SKIN["rest"], SKIN["modes"], SKIN["triangles"], [line, Line(0, INSIDE[:1], 2.0)])
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
    pair = {"kind": "chambers", "module": 2, "chambers": [1, 2]}
    trunk = lines({"geometry": {"kind": "stiff-flop"}, "actuators": [pair]}, 110.0)
    assert [one.actuator for one in trunk] == [0, 0]
    assert [one.points[[0, -1], 0].tolist() for one in trunk] == [[55.0, 110.0]] * 2
    assert np.linalg.norm(trunk[0].points[:, 1:], axis=1) == pytest.approx(4.0)
    cavity = lines({"geometry": {"kind": "step"}, "actuators": [{"kind": "cavity", "inside": [1, 2, 3]}]}, 50.0)
    assert cavity[0].points.tolist() == [[1.0, 2.0, 3.0]]
    assert lines({"geometry": {}, "actuators": [{"kind": "cavity", "surface": "inner"}]}, 50.0) == []
    assert lines(None, 50.0) == []


def test_sharp_edges_part_a_surface_and_smooth_ones_do_not():
    """A cube whose faces are two triangles: each corner is lit from three sides. A round bar stays whole."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))])
    again, parted = sharpened(corners, triangles, 100)
    assert sorted(again) == sorted([*range(8)] * 2)
    assert len(np.unique(parted)) == 24 and parted.max() == 100 + 15
    places = np.concatenate([corners, np.zeros((92, 3)), corners[again]])
    assert (places[parted] == corners[triangles]).all()
    for one in range(6):
        others = np.delete(parted, [2 * one, 2 * one + 1], axis=0)
        assert not np.isin(parted[2 * one : 2 * one + 2], others).any()
    again, parted = sharpened(SKIN["rest"], SKIN["triangles"], len(SKIN["rest"]))
    assert len(again) == 0 and (parted == SKIN["triangles"]).all()
