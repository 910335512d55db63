"""The bellows: its volume and its chamber from its lengths, and that its folds meet when it is sucked empty."""

from pathlib import Path

import numpy as np
import pytest

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[3] / "pipelines" / "bellows" / "scene.yaml"


def scene(*changes):
    return load_spec(SCENE, SceneSpec, list(changes))


@pytest.fixture(scope="module")
def small():
    """One fold, so that a solve is short."""
    own = scene("geometry.folds=1", "length=16 mm", "mesh.size=6 mm", "actuators.0.reach={mm^3: [-1200, 800]}")
    mesh, volume = make_mesh(own, SCENE.parent)
    return mesh, volume, build_robot(own, mesh)


def frustum(length, first, second):
    return np.pi * length * (first**2 + first * second + second**2) / 3


def test_volume_and_chamber_are_those_of_its_lengths(small):
    """The chamber's slopes are those of the outside, 1.5 mm farther in along their normal."""
    mesh, volume, robot = small
    outside = 2 * frustum(3.0, 7, 7) + frustum(3.0, 13, 13) + 2 * (frustum(1.5, 7, 7) + frustum(2.0, 7, 13))
    aside = 1.5 * np.hypot(6, 2) / 6 - 1.5 * 2 / 6
    inside = 2 * frustum(1.5 + aside, 5.5, 5.5) + 2 * frustum(2.0, 5.5, 11.5) + frustum(3 - 2 * aside, 11.5, 11.5)
    assert volume == pytest.approx(outside - inside)
    assert 0.9 * inside < robot.actuators[0].rest_volume < inside  # straight edges on round walls
    assert robot.rest_e.tolist() == [16.0, 0.0, 0.0]
    assert mesh.X[:, 0].min() == 0 and mesh.X[:, 0].max() == 16


def test_it_grows_and_shrinks_along_its_axis_and_stiffens_where_folds_meet(small):
    _, _, robot = small
    problem, start, pulled = Problem(robot), None, []
    for volume in (300.0, -500.0, -800.0, -1100.0):
        start = solve(problem, displacement([volume]), base=start and start.state)
        assert start.converged
        pulled.append((start.delta_e[0], start.lambda_a[0], len(start_pairs(problem, start))))
    (grown, blown, _), (_, first, none), _, (shrunk, sucked, pushing) = pulled
    assert grown > 1 and blown > 0 and shrunk < -2
    assert none == 0 and pushing > 20
    assert sucked / first > 3  # at 2.2 times the volume


def start_pairs(problem, state):
    return problem.evaluate(state.state.x, state.state.pressure).response.contact.pairs


@pytest.mark.parametrize(
    "change, said",
    [
        ("geometry.wall=7 mm", "the wall must be thinner than narrow, and than wide less narrow"),
        ("geometry.crest=1.5 mm", "crest must be above 2.16 mm"),
    ],
)
def test_lengths_that_do_not_go_together_are_refused(change, said):
    with pytest.raises(SpecError, match=said):
        scene(change)
