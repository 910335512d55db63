"""The bar of the tests, and its model that may be touched at every node."""

import numpy as np
import pytest

from cfem.equilibrium.contact.node_compliance import node_response
from cfem.predict.contact.surface.node_model import NodeModel, node_patches
from cfem.predict.load import load_model
from cfem.predict.series.few_states import patch_states
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh


@pytest.fixture(scope="module")
def robot(bar):
    return build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))


@pytest.fixture(scope="module")
def nodes(bar, robot):
    model = load_model(bar / "models" / "bar" / "spectral")
    states = patch_states(model.domain, 1)
    by_fe = node_response(robot, model.skin.watched, states, np.array([0, len(states) - 1]), 60, 10.0, 5.0)
    return NodeModel(model, node_patches(model), by_fe)
