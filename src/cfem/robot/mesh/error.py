"""The error of a mesh, estimated for all commands from a few of them on a finer one.

The robot on a mesh of cells half as large takes the same commands. Where the error goes with h^p, it is the difference
of the two times 1 / (1 - 2^-p) (Richardson; Roache, Annual Review of Fluid Mechanics 29, 1997). p is 2 for smooth
displacements, more for rods, and 1 or less where a notch, an edge that is held, or a cable's guide smaller than the
cells dominates. Which it is takes a third mesh of 64 times as many cells; so the error is stated between the difference
itself and what the lowest order gives.

Over the range of commands the error relative to the effectors' travel changes little. What changes it is how far the
body bends. So it is taken at rest, in the direction of each state, by the compliance of both meshes, and in the states
themselves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.mesh_error import ErrorShare
from cfem.condensed.spread import outermost, spread
from cfem.core.console.progress import doing, progress
from cfem.core.errors import CfemError
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation, displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import Equilibrium, State
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.mesh.error_spec import MeshErrorSpec
from cfem.robot.mesh.finer import carried_over, dimensions, finer_mesh
from cfem.robot.spec import SceneSpec

LOWEST = 0.9  # order of the error that is allowed for: that of hexahedra with a cable
EXACT = 1e-6  # share that solves leave where the mesh errs less, as that of a rod in a circle
STILL = 1e-6  # of the robot's length: below it effectors have not moved
COARSEST = 0.15  # share by which the meshes may differ: beyond, no order says what is left (docs/figures/mesh-error.md)
FAR = 0.5  # of the largest travel: states from which the error of large travels is taken


@dataclass(frozen=True)
class CommandResponse:
    """Response of a robot to a command.

    tip: mm, of all effector points from rest; reaction: (n_a,) of what is not commanded"""

    tip: np.ndarray
    reaction: np.ndarray


@dataclass(frozen=True)
class Compared:
    """One command on both meshes: the shares by which each quantity differs, of a small command in its direction and of
    the command itself.

    travel: mm; reaction: the largest of what is not commanded"""

    travel: float
    reaction: float
    tip: tuple[float, float]
    actuators: tuple[float, float]
    reach: float


def chosen(points: np.ndarray, rest: np.ndarray, count: int) -> list[int]:
    """Indices of `count` points (m, n): the one farthest from rest, then again and again the one farthest from those
    chosen."""
    return spread(points, count, outermost(points, rest)).tolist()


def mesh_error(
    scene: SceneSpec,
    mesh: Mesh,
    robot: Robot,
    folder: Path,
    states: Sequence[Equilibrium],
    spec: MeshErrorSpec,
    load: Callable[[Robot], Robot] = lambda robot: robot,
    coarsest: float = COARSEST,
) -> dict[str, Any]:
    """Estimated error of the mesh, as plain data: `MeshError`; upper bounds for the states given, which are `tip_mm`,
    `tip_percent` of the scene's length, `travel_percent` of how far the effectors move, `reach_percent` by which that
    changes, and `force_percent` of the largest actuator's force (displacement, where forces are commanded); and
    `factorizations` on the finer mesh. Where it could not be estimated, only `left_out`: the sentence that says why;
    where the mesh is too coarse for that, `apart_percent` too: how far apart the two meshes are, of the travel.

    states: of the robot on `mesh`; load: puts the loads of these states on the robot of the finer mesh; coarsest: share
    of the effectors' travel by which the two meshes may differ at most"""
    expected = 2 ** dimensions(scene) * len(mesh.cells)
    if expected > spec.largest:
        return {"left_out": f"the finer mesh would have {expected} cells, and mesh_error.largest is {spec.largest}"}
    still = STILL * robot.length
    states = [state for state in states if np.abs(state.delta_e).max() > still]
    if not states:
        return {"left_out": "the commands leave the robot at rest"}
    doing("meshing more finely, for the error of the mesh")
    try:
        finer = finer_mesh(scene, mesh, folder)
        refined = Problem(load(build_robot(scene, finer)))
    except CfemError as error:
        return {"left_out": f"there is no finer mesh: {error}"}
    compared, factorizations = _compared(Problem(load(build_robot(scene, mesh))), mesh, refined, finer, states)
    if not compared:
        return {"left_out": "no state converged on the finer mesh"}
    smaller = (len(finer.cells) / len(mesh.cells)) ** (1 / dimensions(scene))
    if smaller <= 1:
        return {"left_out": f"the finer mesh has {len(finer.cells)} cells, no more than the mesh at hand"}
    found = stated(compared, smaller, robot.length)
    apart = max(found["tip"][where][0] for where in ("rest", "far"))
    if apart > coarsest:
        what = f"{len(mesh.cells)} cells are too few: on cells half as large the effectors are {100 * apart:.0f} % of"
        what += f" their travel away, and more than {100 * coarsest:g} % say nothing of what is left"
        return {"left_out": what, "apart_percent": 100 * apart}
    meshes = {"cells": len(mesh.cells), "finer_cells": len(finer.cells)}
    return {**meshes, **found, "factorizations": factorizations}


def stated(compared: Sequence[Compared], smaller: float, length: float) -> dict[str, Any]:
    """Error of the mesh at hand from commands on it and on a mesh of cells `smaller` times as small."""
    factors = 1.0, 1 / (1 - smaller**-LOWEST)  # of an order so high that the finer mesh is exact, and of the lowest
    largest = max(each.travel for each in compared)
    far = [each for each in compared if each.travel >= FAR * largest]

    def bounds(shares: Sequence[float]) -> tuple[float, float]:
        low, high = (float(factor * extreme(shares)) for factor, extreme in zip(factors, (min, max), strict=True))
        return low, high

    def share(key: str, quantity: float) -> ErrorShare:
        at_rest, at_state = np.maximum([getattr(each, key) for each in far], EXACT).T
        return ErrorShare(rest=bounds(at_rest), far=bounds(at_state), largest=max(quantity, np.finfo(float).tiny))

    tip, actuators = share("tip", largest), share("actuators", max(each.reaction for each in compared))
    reach = factors[1] * max(each.reach for each in compared) / largest
    return {
        "states": len(compared),
        "tip": tip.model_dump(mode="json"),
        "actuators": actuators.model_dump(mode="json"),
        "tip_mm": tip.highest * largest,
        "tip_percent": 100 * tip.highest * largest / length,
        "reach_percent": 100 * reach,
        "travel_percent": 100 * tip.highest,
        "force_percent": 100 * actuators.highest,
    }


def _compared(
    problem: Problem, mesh: Mesh, refined: Problem, finer: Mesh, states: Sequence[Equilibrium]
) -> tuple[list[Compared], int]:
    """The states that converged on the finer mesh, each from the one before where its own start is no good, from small
    travels to large ones; and its factorisations."""
    robot = problem.robot
    free = force(np.zeros(robot.rows.n_a))
    resting = solve(problem, free), solve(refined, free)
    factorizations, compared, base = resting[1].factorizations, [], None
    states = sorted(states, key=lambda state: np.linalg.norm(state.delta_e))
    tetrahedra = mesh.cells.shape[1] in (4, 10)
    with progress("commands on the finer mesh", len(states)) as advance:
        for state in states:
            start = (
                State(carried_over(mesh, state.state.x, finer), np.empty(0), state.state.lam) if tetrahedra else None
            )
            solved = solve(refined, _command(robot, state), start, base, wanted=Wanted(condense=False))
            base = solved.state if solved.converged else base
            factorizations += solved.factorizations
            advance(1)
            if solved.converged and all(rest.converged for rest in resting):
                compared.append(_compare(robot, resting, state, solved))
    return compared, factorizations


def _command(robot: Robot, state: Equilibrium) -> Actuation:
    """The command of a state: pressures where the scene states them, else displacements."""
    return displacement(state.delta_a) if robot.forces is None else force(state.lambda_a)


def _compare(robot: Robot, resting: Sequence[Equilibrium], state: Equilibrium, finer: Equilibrium) -> Compared:
    """One command on both meshes. Orientations of effectors are left out, as they are no lengths."""
    places = [index for index, name in enumerate(robot.rows.effectors) if not name.split(".")[-1].startswith("r")]
    by_force = robot.forces is not None
    solved = [
        CommandResponse(each.delta_e[places], each.delta_a if by_force else each.lambda_a) for each in (state, finer)
    ]
    linear = [_linear(rest, resting[0], state, places, by_force) for rest in resting]
    travel, reaction = float(np.linalg.norm(solved[0].tip)), float(np.abs(solved[0].reaction).max())
    return Compared(
        travel=travel,
        reaction=reaction,
        tip=(_difference(linear, "tip"), _difference(solved, "tip")),
        actuators=(_difference(linear, "reaction"), _difference(solved, "reaction")),
        reach=abs(float(np.linalg.norm(solved[1].tip)) - travel),
    )


def _linear(
    rest: Equilibrium, coarse: Equilibrium, state: Equilibrium, places: list[int], by_force: bool
) -> CommandResponse:
    """Response to a small command in the direction of a state's forces, by the compliance at rest. coarse: the rest
    of the mesh at hand, whose displacements are those commanded."""
    rows, lam = rest.condensed.rows, state.lambda_a
    pulling = np.abs(lam) > STILL * np.abs(lam).max()
    effectors, actuators = np.array(places), np.arange(rows.n)[rows.a][pulling]
    W, commanded = rest.condensed.W, lam[pulling]
    within = np.ix_(actuators, actuators)
    if by_force:
        return CommandResponse(W[np.ix_(effectors, actuators)] @ commanded, W[within] @ commanded)
    carried = np.linalg.solve(W[within], coarse.condensed.W[within] @ commanded)
    return CommandResponse(W[np.ix_(effectors, actuators)] @ carried, carried)


def _difference(responses: Sequence[CommandResponse], key: str) -> float:
    """Difference of two responses relative to the first."""
    norm = np.linalg.norm if key == "tip" else (lambda values: np.abs(values).max())
    coarse, fine = (getattr(response, key) for response in responses)
    return float(norm(fine - coarse) / max(norm(coarse), np.finfo(float).tiny))
