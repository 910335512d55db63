"""docs/measured.md as a new user follows it: its specs, from recordings of two weights to the modulus."""

import json
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from identify.recordings.recordings import PLACES, SHIFT, TURN, write_c3d, write_optitrack

from cfem.core.stage import Options
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.identify.cases.stage import run as calibrate
from cfem.identify.recordings.stage import run as reduce
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.stage import run as mesh

ROOT = Path(__file__).parents[3]
QUIET = Options(quiet=True)
YOUNG = 264.0  # kPa, of the scene


def fallen(folder, weight):
    """(6, 3) mm: where the markers are under the weight."""
    problem = Problem(build_robot(*load_scene_and_mesh(folder / "scene.yaml")))
    at = solve(problem, force(np.array([weight])), wanted=Wanted(condense=False))
    assert at.converged
    moved = at.delta_e.reshape(3, 3)
    places = np.array(list(PLACES.values()))
    return places + np.vstack([np.zeros((3, 3)), moved])


def recorded(places, rng):
    """time and points in the cameras' frame: a second of rest, a fall, a second and a half of rest."""
    time = np.arange(350) / 100
    share = np.clip((time - 1) / 0.5, 0, 1)[:, None, None]
    rest = np.array(list(PLACES.values()))
    points = (rest + share * (places - rest) - SHIFT) @ TURN
    return time, points + 0.05 * rng.standard_normal(points.shape)


@pytest.mark.slow
def test_the_specs_of_the_page_lead_from_recordings_to_the_modulus(tmp_path):
    pytest.importorskip("c3d")
    blocks = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "measured.md").read_text(), re.S)
    folder = tmp_path / "pipelines" / "my-robot"
    folder.mkdir(parents=True)
    (folder / "measurements.yaml").write_text(blocks[0])
    (folder / "cases.yaml").write_text(blocks[1] + "figure: false\n")
    beam = (ROOT / "pipelines" / "measured-beam" / "scene.yaml").read_text()
    coarse = beam.replace("measured-beam", "my-robot").replace("size: 10 mm", "size: 15 mm")
    (folder / "scene.yaml").write_text(coarse)
    mesh(folder / "scene.yaml", [], None, QUIET)
    rng = np.random.default_rng(1)
    for name, weight, write in (("half.csv", 0.5, write_optitrack), ("full.c3d", 1.0, write_c3d)):
        time, points = recorded(fallen(folder, weight), rng)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the writer of .c3d misses analog channels
            write(folder / name, time, points, [f"Unlabeled {i}" for i in range(6)])
    assert reduce(folder / "measurements.yaml", [], None, QUIET)["results"]
    calibrate(folder / "cases.yaml", [], None, QUIET)
    found = json.loads((tmp_path / "data" / "my-robot" / "calibrated" / "calibration.json").read_text())
    low, high = found["estimates"]["young"]["interval"]
    assert low < YOUNG / 1000 < high and found["estimates"]["young"]["value"] == pytest.approx(YOUNG / 1000, rel=0.01)
