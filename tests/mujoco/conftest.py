"""The bar as a soft robot in MuJoCo: a beam along x, held at x = 0, with a cable."""

import pytest

from cfem.mujoco import SoftRobot
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh


@pytest.fixture(scope="session")
def fe_bar(bar):
    return build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))


@pytest.fixture(scope="session")
def soft_bar(patched_bar):
    return SoftRobot(patched_bar)
