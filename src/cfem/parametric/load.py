"""Families from files."""

from collections.abc import Sequence
from pathlib import Path

from cfem.condensed.parameters import Parameter
from cfem.core.spec import load_spec
from cfem.parametric.family import FiniteElements, Learned
from cfem.predict.load import load_model
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.same import demand_robot
from cfem.robot.spec import SceneSpec
from cfem.sample.rest import Rest


def learned(model: Path, scene: Path | None = None) -> Learned:
    """Of a model folder; scene: of a model of several shapes."""
    predictor = load_model(model)
    if scene is None:
        return Learned(predictor, None)
    spec = load_spec(scene, SceneSpec)
    demand_robot(spec, predictor.meta.get("robot"), model, f"train a model of {scene}, or name the scene of this one")
    return Learned(predictor, Rest(spec, predictor.parameters, predictor.rest_e))


def finite_elements(scene: Path, mesh: Path, parameters: Sequence[Parameter]) -> FiniteElements:
    """Of a scene on a mesh artefact."""
    return FiniteElements(*load_scene_and_mesh(scene, mesh), parameters)
