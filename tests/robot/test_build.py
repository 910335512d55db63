"""The bar from its YAML: rows, sizes, and that it pays for nothing that it has not."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.robot.build import build_robot
from cfem.robot.meshing import make_mesh
from cfem.robot.spec import SceneSpec

PIPELINES = Path(__file__).parents[2] / "pipelines"
BAR = PIPELINES / "bar" / "scene.yaml"


@pytest.fixture(scope="module")
def bar():
    scene = load_spec(BAR, SceneSpec)
    mesh, _ = make_mesh(scene, BAR.parent)
    return scene, mesh


def test_rows_reach_and_rest(bar):
    robot = build_robot(*bar)
    assert robot.rows.names == ("tip.x", "tip.y", "tip.z", "cable")
    np.testing.assert_array_equal(robot.reach, [[0.0, 8.0]])
    np.testing.assert_allclose(robot.rest_e, [59.0, 0, 0], atol=1e-12)
    assert (robot.body.mesh.X[robot.fixed, 0] == 0).all()


def test_the_finger_is_symmetric_and_its_tip_is_carried(tmp_path):
    path = PIPELINES / "soft-finger" / "scene.yaml"
    scene = load_spec(path, SceneSpec, ["mesh.element=tet4"])
    robot = build_robot(scene, make_mesh(scene, path.parent)[0])
    assert robot.rows.actuators == ("left", "right")
    np.testing.assert_allclose(robot.rest_e, [0, 10, -120], atol=1e-12)
    assert [cable.rest_length for cable in robot.actuators] == pytest.approx([110.6667] * 2)


@pytest.mark.parametrize(
    "override, part",
    [
        ("actuators.0.points={mm: [[15, 0, 4], [35, 40, 4]]}", "cable 'cable' point 2 at (35, 40, 4) mm lies outside"),
        ("fixed.0.point={mm: [-50, 0, 0]}", "selects no node"),
        ("actuators.0.points={mm: [[15, 0, 4], [15, 0, 4]]}", "coincide"),
        ("effectors.0.point={mm: [300, 0, 0]}", "lies outside the body"),
    ],
)
def test_what_cannot_be_built_is_named(bar, override, part):
    scene = load_spec(BAR, SceneSpec, [override])
    with pytest.raises(SpecError, match=__import__("re").escape(part)):
        build_robot(scene, bar[1])


def test_the_smallest_scene_pays_for_nothing_that_it_has_not(bar):
    """No contact rows, no design parameters, one cable; and no torch, gmsh, matplotlib or onnx to solve it."""
    robot = build_robot(*bar)
    assert (robot.rows.n, robot.rows.n_c) == (4, 0)
    code = (
        "import sys\n"
        "from cfem.equilibrium import problem, solve\nfrom cfem.robot import build, load\nimport cfem.sample.runner\n"
        "print([m for m in ('torch', 'gmsh', 'matplotlib', 'onnx', 'onnxruntime', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
