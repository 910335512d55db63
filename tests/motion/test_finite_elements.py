"""Motion of full finite elements with a payload at one of several effectors."""

from dataclasses import replace

import numpy as np
import pytest
from support.bar_scene import bar_scene

from cfem.core.errors import InputError
from cfem.core.spec import load_spec
from cfem.motion.commands import CommandTable
from cfem.motion.finite_elements import simulate_full
from cfem.motion.payload import Payload
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

NOTHING = CommandTable("force", np.zeros(1), np.zeros((1, 1)))
HALF_WAY = "{name: middle, point: {mm: [29, 0, 0]}}, "
WEIGHT = (0.0, 0.0, -9810.0)  # mm/s^2


@pytest.fixture(scope="module")
def robot(tmp_path_factory):
    """A bar that is watched half way and at its tip."""
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    text = bar_scene(8, "tet4", 0.45).replace("effectors: [", f"effectors: [{HALF_WAY}")
    path.write_text(text.replace("young: 1 MPa", "young: 1 MPa, density: 1 g/cm^3"))
    scene = load_spec(path, SceneSpec)
    return build_robot(scene, make_mesh(scene, path.parent)[0])


def sag(robot, rows):
    """mm by which the tip hangs lower with a payload of 0.1 g at these rows, at the start and a millisecond later."""
    run = simulate_full(robot, NOTHING, 1e-3, 1e-3, Payload(1e-7, rows, WEIGHT), np.array([True]))
    assert run.why is None
    return -run.of("delta_e")[:, 5]


def test_a_payload_hangs_at_the_effector_that_is_named(robot):
    """A cantilever's tip sags by F a^2 (3 l - a) / (6 E I) under a force at a: 5/16 half way of what it does at l."""
    middle, tip = sag(robot, (0, 1, 2)), sag(robot, (3, 4, 5))
    assert tip[0] > 0.01
    assert middle[0] / tip[0] == pytest.approx(5 / 16, rel=0.1)
    np.testing.assert_allclose([middle[1], tip[1]], [middle[0], tip[0]], rtol=1e-3)  # it begins at rest


def test_a_payload_at_no_point_of_the_body_is_refused(robot):
    """Effectors with a direction have six rows, so that none tells the number of the effector."""
    turned = replace(robot, effectors=robot.effectors[:1])
    with pytest.raises(InputError, match="at points in the body only"):
        simulate_full(turned, NOTHING, 1e-3, 1e-3, Payload(1e-7), np.array([True]))
