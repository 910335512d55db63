"""The robot of a design that a run controls, and the models that are bound to it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.bar_scene import bar_scene

from cfem.control.task.design import designed
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import scene_parameters
from cfem.sample.spec import ParameterSpec

PARAMETERS = {
    "length": ParameterSpec(key="geometry.length", range=["59 mm", "62 mm"]),
    "nu": ParameterSpec(key="material.poisson", range=[0.4, 0.48]),
}


@pytest.fixture(scope="module")
def family(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    (folder / "scene.yaml").write_text(bar_scene(8, "tet4", 0.45).replace("point: {mm: [58, 0, 0]}", "at: tip"))
    scene = load_spec(folder / "scene.yaml", SceneSpec)
    return scene, make_mesh(scene, folder)[0], tuple(scene_parameters(PARAMETERS, folder / "scene.yaml"))


def models(*parameters):
    return {f"model-{number}": SimpleNamespace(parameters=each) for number, each in enumerate(parameters)}


def test_all_models_are_bound_to_the_design_and_its_tip_moves_with_its_length(family):
    scene, mesh, parameters = family
    robot, bound, shift = designed(scene, mesh, models(parameters, parameters), {"length": "61 mm"})
    assert robot.body.mesh.X[:, 0].max() == pytest.approx(61.0)
    assert [model.p.tolist() for model in bound.values()] == [[61.0, 0.45]] * 2
    np.testing.assert_allclose(shift, [59 / 60, 0, 0], atol=1e-9)  # the tip is watched at 59 of 60 mm


def test_models_of_different_parameters_are_refused(family):
    scene, mesh, (length, poisson) = family
    narrower = replace(length, high=61.5)
    for other in ((length,), (narrower, poisson)):
        with pytest.raises(SpecError, match="the models have different parameters"):
            designed(scene, mesh, models((length, poisson), other), {})
