"""The bar as a soft robot in MuJoCo: a beam along x, held at x = 0, with a cable."""

from dataclasses import replace

import pytest
import yaml

import cfem
from cfem.mujoco import SoftRobot
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh


@pytest.fixture(scope="session")
def fe_bar(bar):
    return build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))


@pytest.fixture(scope="session")
def soft_bar(patched_bar):
    return SoftRobot(patched_bar)


@pytest.fixture(scope="session")
def bar_of_nodes(bar):
    """Makes the bar that touches at every node; its cable is held, as that of `soft_bar`."""
    folder, specs = bar / "models" / "bar" / "spectral", bar / "pipelines" / "bar"
    return lambda: replace(SoftRobot.load(folder, specs / "scene.yaml"), unilateral=None)


@pytest.fixture(scope="session")
def heavy_scene(bar):
    """The bar whose model knows its weight, by rows of its centre of mass."""
    specs, asked = bar / "pipelines" / "bar", ["scene=heavy.yaml", "loads=true", "out=../../data/bar/heavy"]
    scene = yaml.safe_load((specs / "scene.yaml").read_text())
    scene["material"]["density"] = "1070 kg/m^3"
    scene["effectors"].append({"name": "body", "at": "centre-of-mass"})
    (specs / "heavy.yaml").write_text(yaml.safe_dump(scene))
    cfem.run_stage("sample", specs / "sample.yaml", overrides=asked, workers=1)
    trained = ["dataset=../../data/bar/heavy", "out=../../models/bar/heavy"]
    cfem.run_stage("train", specs / "train.yaml", overrides=trained)
    return specs / "heavy.yaml"


@pytest.fixture(scope="session")
def heavy_bar(bar, heavy_scene):
    return SoftRobot.load(bar / "models" / "bar" / "heavy", heavy_scene, patches=8.0)
