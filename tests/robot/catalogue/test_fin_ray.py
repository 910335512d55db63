"""The Fin Ray finger: its volume from its lengths, and that its tip bends towards what presses its front."""

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

SCENE = Path(__file__).parents[3] / "pipelines" / "fin-ray" / "scene.yaml"


def scene(*changes):
    return load_spec(SCENE, SceneSpec, list(changes))


@pytest.fixture(scope="module")
def coarse():
    own = scene("mesh.size=12 mm")
    mesh, volume = make_mesh(own, SCENE.parent)
    return mesh, volume, build_robot(own, mesh)


def test_volume_is_that_of_its_lengths(coarse):
    mesh, volume, robot = coarse
    slope = (40 - 4.5) / 80
    inside = 40 - 1.5 * np.hypot(1, slope)  # z of the back's inside at x = 0
    end = min((inside - 3) / slope, 77)
    hollow = (end - 4) * (inside - 1.5 - slope * (4 + end) / 2)
    lean = np.tan(np.radians(35))
    middles = 4 + (end - 4) * np.arange(1, 5) / 5
    ribs = 1.5 / np.cos(np.radians(35)) * ((inside - 1.5 - slope * middles) / (1 + slope * lean)).sum()
    assert volume == pytest.approx(20 * (80 * (40 + 4.5) / 2 - hollow + ribs))
    assert mesh.volumes.sum() == pytest.approx(volume)
    assert robot.rest_e.tolist() == [80.0, 0.0, 2.25]


def test_its_tip_first_follows_what_presses_its_front_and_then_bends_towards_it(coarse):
    problem, base, tips = Problem(coarse[2]), None, []
    for depth in (3.0, 7.0, 12.0):
        state = solve(problem, displacement([depth]), base=base)
        assert state.converged and state.lambda_a[0] > 0
        base = state.state
        tips.append(state.delta_e)
    z = np.array(tips)[:, 2]
    assert 0 < z[0] < 0.3 * 3 and z[1] < z[0] and z[2] < -2  # a plain bar's tip goes with the push, and farther
    assert np.abs(np.array(tips)[:, 1]).max() < 1e-4


@pytest.mark.parametrize(
    "change, said",
    [
        ("geometry.tip=3 mm", "tip must be above 2 wall"),
        ("geometry.base=4 mm", "base above tip"),
        ("geometry.ribs=40", "the ribs fill the finger"),
        ("geometry.rib_angle=-50 deg", "the ribs fill the finger"),
    ],
)
def test_lengths_that_do_not_go_together_are_refused(change, said):
    with pytest.raises(SpecError, match=said):
        scene(change)


@pytest.mark.parametrize("angle", ["-15 deg", "0 deg", "45 deg"])
def test_rooms_of_ribs_of_any_lean_are_within_the_finger(angle):
    from cfem.robot.catalogue.fin_ray import rooms

    spec = scene(f"geometry.rib_angle={angle}").geometry
    for room in rooms(spec):
        x, z = np.array(room).T
        assert x[0] < x[1] and x[3] < x[2] and (z[2:] > z[:2]).all()
        np.testing.assert_allclose((40 - 1.5 * np.hypot(1, 35.5 / 80) - 35.5 / 80 * x[2:]), z[2:])
