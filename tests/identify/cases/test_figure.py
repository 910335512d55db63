"""Which way up the figure stands, and cases without an equilibrium."""

import numpy as np
from support.blocks import block

from cfem.identify.cases import figure
from cfem.identify.cases.figure import _views, shapes_figure
from cfem.identify.cases.robots import Pose
from cfem.identify.cases.table import Cases

MESH = block((40.0, 10.0, 10.0), (4, 1, 1))


def test_gravity_points_down():
    across_the_beam, along_it = np.array([0, 0, -9.81]), np.array([9.81, 0, 0])
    assert _views(MESH.X, across_the_beam) == [(0, 2, 1.0), (0, 1, 1.0)]
    assert _views(MESH.X, along_it) == [(2, 0, -1.0), (1, 0, -1.0)]
    assert _views(MESH.X, None) == [(2, 0, -1.0), (1, 0, -1.0)]


def test_cases_without_an_equilibrium_are_drawn_as_measured():
    places = np.zeros((2, 1, 3))
    cases = Cases(("a", "b"), ("", ""), np.zeros((2, 1)), np.ones(2), places, None)
    posed = (Pose(np.zeros((1, 3)), np.eye(3)[None], MESH.X + 1), None)
    computed = np.array([[[1.0, 0, 0]], [[np.nan] * 3]])
    made = shapes_figure(cases, posed, computed, np.abs(computed), 0.95, MESH, "Cases", np.array([0, 0, -1.0]))
    assert made[:4] == b"\x89PNG"


def test_cases_that_are_left_out_are_said(monkeypatch):
    monkeypatch.setattr(figure, "png", lambda drawn: drawn)
    for count, title in ((20, "Cases"), (21, "Cases (the first 20 of 21)")):
        cases = Cases(
            ("a",) * count, ("",) * count, np.zeros((count, 1)), np.ones(count), np.zeros((count, 1, 3)), None
        )
        drawn = shapes_figure(cases, (None,) * count, cases.places, cases.places, 0.9, MESH, "Cases")
        assert drawn.get_suptitle() == title
        assert drawn.legends[0].get_texts()[1].get_text() == "computed, with 90 % intervals"
        assert sum(ax.get_visible() for ax in drawn.axes) == 2 * 20
