"""Natural frequencies of finite elements at the test states of a dataset, by which those of a model are judged."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.console.progress import progress
from cfem.core.errors import NumericalError
from cfem.dataset.reader import read_dataset
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation, displacement, force
from cfem.equilibrium.system.solution import State
from cfem.fe_motion.modes import natural_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.spec import SceneSpec

MODES = 3


def sampled_frequencies(dataset: Path, scene: SceneSpec, mesh: Mesh) -> dict[str, Any]:
    """Hz of the lowest `MODES`, a list for each converged state of a dataset's file: `held`, with the actuators still,
    and `free`, with constant forces. None where the robot is unstable so, or was not solved again."""
    rows, problem = read_dataset(dataset), MovingProblem(build_robot(scene, mesh))
    frequencies: dict[str, Any] = {"held": [], "free": []}
    with progress("natural frequencies of the test states", len(rows)) as advance:
        for delta in rows.delta_a:
            solved = solve(problem, displacement(delta), slack=False, wanted=Wanted(condense=False))
            for kind, command in (("held", None), ("free", force(np.zeros(rows.rows.n_a)))):
                frequencies[kind].append(_lowest(problem, solved.state, command) if solved.converged else None)
            advance(1)
    return frequencies


def _lowest(problem: MovingProblem, state: State, command: Actuation | None) -> list[float] | None:
    try:
        return natural_modes(problem, state, MODES, command).frequency.tolist()
    except NumericalError:
        return None
