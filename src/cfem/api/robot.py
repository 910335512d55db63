"""A scene as a finite-element robot, and its equilibria."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from cfem.api.vectors import PathLike, vector
from cfem.core.errors import NumericalError, SpecError
from cfem.core.optional import says_what_is_missing

if TYPE_CHECKING:
    from cfem.equilibrium.system.robot import Robot
    from cfem.equilibrium.system.solution import Equilibrium


@says_what_is_missing
def load_robot(scene: PathLike, mesh: PathLike | None = None, *, overrides: Sequence[str] = ()) -> "Robot":
    """The finite-element robot of a scene.

    Args:
        scene: the scene.yaml.
        mesh: a folder of `cfem mesh`; without one the robot is meshed now, in memory.
        overrides: values of the scene in place of its own, such as `"mesh.size=8 mm"`.

    Returns:
        The robot: `rows` (names of effector and actuator rows), `reach` (n_a, 2), `rest_e` (n_e,) mm, `X` (n, 3) mm.

    Raises:
        SpecError: the scene is wrong; the message names file, line and key.
        InputError: a file is missing or damaged.
        NumericalError: the shape cannot be meshed.

    Examples:
        >>> robot = cfem.load_robot("pipelines/bar/scene.yaml")
        >>> robot.rows.actuators, robot.reach
    """
    from cfem.core.artefact.content import artefact_file
    from cfem.core.spec import load_spec
    from cfem.robot.build import build_robot
    from cfem.robot.mesh.accuracy import scene_mesh
    from cfem.robot.mesh.mesh_file import read_mesh
    from cfem.robot.spec import SceneSpec
    from cfem.robot.stage import MESH

    spec = load_spec(Path(scene), SceneSpec, overrides)
    if mesh is None:
        return build_robot(spec, scene_mesh(spec, Path(scene).parent)[0])
    return build_robot(spec, read_mesh(artefact_file(Path(mesh), MESH)))


@says_what_is_missing
def solve(
    robot: "Robot",
    *,
    displacement: ArrayLike | None = None,
    force: ArrayLike | None = None,
    start: "Equilibrium | None" = None,
) -> "Equilibrium":
    """One equilibrium of the finite-element robot. For many, `FemPlant` starts each solve from those before.

    Args:
        robot: of `load_robot`.
        displacement: (n_a,) of the actuators, mm or mm^3. Cables that would have to push go slack.
        force: (n_a,) of the actuators, N or MPa. Neither: actuators are free.
        start: an equilibrium nearby.

    Returns:
        The equilibrium: `delta_e` (n_e,) mm from rest, `delta_a`, `lambda_a` (n_a,), `condensed` (W, delta_free),
        `energy` N mm, `residual`.

    Raises:
        SpecError: displacement and force are both given, or are not n_a finite numbers.
        NumericalError: there is no stable equilibrium, or it was not found; the message says which.

    Examples:
        >>> found = cfem.solve(robot, displacement=[5.0])
        >>> found.delta_e, found.lambda_a, found.condensed.W
    """
    from cfem.equilibrium.solve import solve as solve_problem
    from cfem.equilibrium.system import actuation
    from cfem.equilibrium.system.problem import Problem

    if displacement is not None and force is not None:
        raise SpecError("got a displacement and a force", do="give one of the two")
    n_a = robot.rows.n_a
    if displacement is not None:
        actuated = actuation.displacement(vector("displacement", displacement, n_a))
    else:
        actuated = actuation.force(np.zeros(n_a) if force is None else vector("force", force, n_a))
    equilibrium = solve_problem(Problem(robot), actuated, None if start is None else start.state)
    if not equilibrium.converged:
        raise NumericalError(
            f"no equilibrium: {equilibrium.status.value}", where=robot.name, do="take a smaller actuation"
        )
    return equilibrium
