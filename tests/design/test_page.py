"""The page of a front holds all its designs and their shapes, and nothing from elsewhere."""

import json
import re

import numpy as np
import pytest
from design.problems import plain

from cfem.design.optimisers.front import best_of_each, pareto_front
from cfem.design.optimisers.search import evaluate_grid
from cfem.design.page import STEPS, front_page, moving, write_page


class Robot:
    name, facets, fixed = "own <finger>", np.array([[0, 1, 2], [1, 3, 2]]), np.array([0, 1])


class Exact:
    """A surface of four nodes whose last is pulled along z."""

    def at(self, kind, u, p):
        self.nodes = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, float(u[0])]])
        self.x_e = self.nodes[3:]
        return self


@pytest.fixture(scope="module")
def made():
    problem = plain(a=lambda p: p[:, 0] + p[:, 1] ** 2, b=lambda p: 1 - p[:, 0] + p[:, 1] ** 2)
    problem.u = np.array([2.0])
    front = pareto_front(
        problem, evaluate_grid(problem, (5, 5)), ("a", "b"), 4, best_of_each(problem, evaluate_grid(problem, (5, 5)), 1)
    )
    shapes = moving(problem, Exact(), front.designs)
    return problem, front, shapes, front_page(problem, front, Robot(), shapes, {"a": {"total": {"x": 0.9, "y": 0.1}}})


def test_every_design_moves_from_rest_to_the_whole_pull(made):
    _, front, shapes, _ = made
    assert len(shapes) == len(front.designs)
    x, tips = shapes[0]
    assert x.shape == (STEPS, 4, 3) and tips[:, 2].tolist() == np.linspace(0, 2, STEPS).tolist()


def test_the_page_says_what_the_front_is(made):
    _, front, _, text = made
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
    assert data["objectives"] == ["a", "b"] and len(data["designs"]) == len(front.designs) == len(data["values"])
    np.testing.assert_allclose(data["values"][0], front.designs[0].objectives)
    assert data["matters"] == {"a": {"x": 0.9, "y": 0.1}}
    takes = json.loads(re.search(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)[1])["takes"]
    assert [one["count"] for one in takes] == [STEPS] * len(front.designs)


def test_the_page_needs_no_network_and_escapes_names(made):
    text = made[3]
    assert not re.search(r"(src|href)=.?https?:", text) and "own &lt;finger&gt;" in text and "<finger>" not in text


def test_designs_on_meshes_of_their_own_are_left_out(made, tmp_path, monkeypatch):
    problem, front, shapes, _ = made
    x, tips = shapes[1]
    others = [shapes[0], (np.zeros((STEPS, 5, 3)), tips), *shapes[2:]]
    monkeypatch.setattr("cfem.design.page.moving", lambda *_: others)

    class OnItsMesh(Exact):
        robot = Robot()
        robot.X = x[0]

    assert write_page(tmp_path, problem, front, OnItsMesh(), None) == "front.html"
    text = (tmp_path / "front.html").read_text()
    data = json.loads(re.search(r'id="data">(.*?)</script>', text, re.DOTALL)[1])
    assert len(data["designs"]) == len(front.designs) - 1
    assert data["values"][1] == pytest.approx(front.designs[2].objectives.tolist())
