"""Families from files."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from cfem.condensed.parameters import Parameter
from cfem.core.errors import SpecError, located
from cfem.core.spec import load_spec
from cfem.parametric.differentiable import FIELDS, VIBRATIONS, Differentiable
from cfem.parametric.family import FiniteElementFamily, LearnedFamily
from cfem.predict.load import load_model
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.same_robot import demand_robot
from cfem.robot.spec import SceneSpec
from cfem.sample.parameters import scene_parameters
from cfem.sample.rest import Rest
from cfem.sample.spec import ParameterSpec


def learned(model: Path, scene: Path | None = None) -> LearnedFamily:
    """Family of a model folder; scene: of a model of several shapes."""
    predictor = load_model(model)
    if scene is None:
        with located(model):
            return LearnedFamily(predictor, None)
    spec = load_spec(scene, SceneSpec)
    demand_robot(spec, predictor.meta.get("robot"), model, f"train a model of {scene}, or name the scene of this one")
    with located(model):
        return LearnedFamily(predictor, Rest(spec, predictor.parameters, predictor.rest_e))


def finite_elements(
    scene: Path, mesh: Path, parameters: Sequence[Parameter], remesh: bool = False
) -> FiniteElementFamily:
    """Family of a scene on a mesh artefact. remesh: whether designs to which the mesh does not stretch get their
    own."""
    folder = scene.parent if remesh else None
    return FiniteElementFamily(*load_scene_and_mesh(scene, mesh), parameters, folder)


def differentiable(
    scene: Path, mesh: Path, parameters: Mapping[str, ParameterSpec], kinds: Sequence[str] = ()
) -> Differentiable:
    """Family of a scene on a mesh artefact, with derivatives by these of its numbers. kinds: of numbers of the body
    that are asked for: volume, mass, those of FIELDS and VIBRATIONS."""
    spec, mesh_there = load_scene_and_mesh(scene, mesh)
    fields = [name for name in (*FIELDS, *VIBRATIONS) if name in kinds]
    robot = Differentiable(spec, mesh_there, scene_parameters(parameters, scene), fields, scene.parent)
    heavy = next((name for name in ("mass", *VIBRATIONS) if name in kinds), None)
    if heavy and robot.mass_unknown:
        what = f"{heavy.split()[-1]} needs the density of each material"
        raise SpecError(what, where="objectives", do="state it in the scene")
    return robot
