"""A new robot made and solved on the coarse mesh before its scene is written, so that what cannot be made is an error
now."""

import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cfem.core.errors import NumericalError, SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.init.drive import Drive, Stated
from cfem.init.let_out import let_out
from cfem.init.question import Answer, Ask
from cfem.init.reach import reaches
from cfem.init.stroke import MARGIN
from cfem.init.texts import NewScene, texts
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.checks.cable_passage import demand_inside
from cfem.robot.mesh.meshing import corners_of, make_mesh
from cfem.robot.spec import SceneSpec

_OPTIONS = {
    "effectors": "--effector",
    "fixed": "--fixed",
    "materials": "--region",
    "rigid": "--rigid",
    "contacts": "--contact",
    "self_contact": "--self-contact",
}
# Of an actuator by its kind, and of its reach.
_ACTUATOR_OPTIONS = {
    "cable": ("--cable", "--reach"),
    "cavity": ("--chamber", "--growth"),
    "push": ("--push", "--travel"),
}
# Cells of which strokes are found with quadratic tetrahedra, and above with linear ones: those are so stiff in thin
# limbs that they do not show where these buckle.
_QUADRATIC = 2500


def tried(robot: NewScene, path: Path, stated: Stated, ask: Ask) -> tuple[NewScene, int]:
    """The robot with how far its actuators go, made on the coarse mesh, so that what cannot be made is an error now;
    and how many cells that has. Actuators that were suggested here and cannot be made are left open."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        shutil.copyfile(path, folder / robot.file)
        spec = _written(_provisional(robot), folder)
        mesh, _ = make_mesh(spec, folder)
        try:
            made = _built(spec, mesh)
        except SpecError as error:
            if stated.cables or stated.chambers or error.where not in (None, "--cable", "--chamber"):
                raise
            robot = replace(robot, drive=Drive(missing=error.what))
            made = _built(_written(_provisional(robot), folder), mesh)
        light, cells = _light(folder, made, mesh)
        reach, contact = reaches(light, robot.drive, len(robot.further.pushes), stated.flags, ask, cells)
        robot = replace(robot, reach=reach, self_contact=contact)
        if robot.n_a:
            robot = replace(robot, least=_least(made, robot))
            _built(_written(robot, folder), mesh)
    return robot, len(mesh.cells)


def _provisional(robot: NewScene) -> NewScene:
    """It with strokes so small that nobody doubts them."""
    little, pushes = Answer(robot.length / 1000), len(robot.further.pushes)
    reach = [little] * len(robot.drive.cables) + [Answer(1e-3)] * len(robot.drive.chambers) + [little] * pushes
    return replace(robot, reach=tuple(reach), least=(0.0,) * robot.n_a)


def _least(made: Robot, robot: NewScene) -> tuple[float, ...]:
    """The lower end of each actuator's reach."""
    rest = solve(Problem(made), force(np.zeros(robot.n_a)))
    if not rest.converged:
        raise NumericalError(f"no equilibrium with free actuators: {rest.status.value}", where="init")
    reach = np.array([answer.value for answer in robot.reach])
    room = [MARGIN * getattr(actuator, "rest_volume", np.inf) for actuator in made.actuators]
    return tuple(let_out(rest.condensed.W_aa, reach, np.array(room)).tolist())


def _written(robot: NewScene, folder: Path) -> SceneSpec:
    (folder / "scene.yaml").write_text(texts(robot)["scene.yaml"], encoding="utf-8")
    return load_spec(folder / "scene.yaml", SceneSpec)


def _light(folder: Path, made: Robot, mesh: Mesh) -> tuple[Robot, str]:
    """The robot in which many states are solved in little time: of linear tetrahedra where it has many cells; and what
    its cells are, in words."""
    spec = load_spec(folder / "scene.yaml", SceneSpec)
    if mesh.order == 1 or len(mesh.cells) <= _QUADRATIC:
        return made, "a coarse mesh"
    meshing = spec.mesh.model_copy(update={"element": "tet4"})
    linear = build_robot(spec.model_copy(update={"mesh": meshing}), corners_of(mesh))
    return linear, "a coarse mesh of linear cells, stiffer than the robot"


def _built(spec: SceneSpec, mesh: Mesh) -> Robot:
    """SpecError that names the option."""
    try:
        robot = build_robot(spec, mesh)
        demand_inside(spec, mesh)
    except SpecError as error:  # the file that it names is not written
        option = _option(spec, (error.where or "").rpartition(": ")[2].split("."))
        do = (error.do or "").replace("set through_air: true where it is meant", "say --through-air yes")
        raise SpecError(error.what, where=option, do=do or None) from None
    return robot


def _option(spec: SceneSpec, key: Sequence[str]) -> str | None:
    """Option that states the value at a key path of the scene, None where there is none."""
    if key[0] != "actuators" or len(key) == 1:
        return _OPTIONS.get(key[0])
    of_actuator, of_reach = _ACTUATOR_OPTIONS[spec.actuators[int(key[1])].kind]
    return of_reach if key[2:] == ["reach"] else of_actuator
