"""What the mesh costs and what it errs: the same robot on several meshes, judged by the finest of them."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.errors import NumericalError
from cfem.report.spec import MeshCase
from cfem.robot.spec import SceneSpec


@dataclass(frozen=True)
class CaseResult:
    """tip: (k,) mm and W: (k,) relative, difference from the finest mesh in each state; seconds: a state,
    median; front: no other mesh is both faster and better in W."""

    case: MeshCase
    nodes: int
    cells: int
    tip: np.ndarray
    W: np.ndarray
    seconds: float
    front: bool

    def as_json(self) -> dict:
        return {
            "element": self.case.element,
            "size": self.case.size,
            "nodes": self.nodes,
            "cells": self.cells,
            "tip_mm_max": float(self.tip.max()),
            "W_relative_max": float(self.W.max()),
            "seconds": self.seconds,
            "front": self.front,
        }


def study(
    scene: SceneSpec, folder: Path, cases: Sequence[MeshCase], shares: Sequence[Sequence[float]]
) -> list[CaseResult]:
    """shares: (k, n_a) in the pulling cube, the states to compare. The case of most unknowns is the reference
    and errs, by definition, by nothing. Raises NumericalError where a state does not converge."""
    solved = [_solve(_at(scene, case), folder, shares) for case in cases]
    finest = max(range(len(cases)), key=lambda i: solved[i][0])
    _, _, tip_ref, W_ref, _ = solved[finest]
    errors = []
    for nodes, cells, tip, W, seconds in solved:
        apart = np.linalg.norm(tip - tip_ref, axis=1)
        W_apart = np.linalg.norm(W - W_ref, axis=(1, 2)) / np.linalg.norm(W_ref, axis=(1, 2))
        errors.append((nodes, cells, apart, W_apart, seconds))
    return [
        CaseResult(case, *row, front=not any(_beats(other, row) for other in errors))
        for case, row in zip(cases, errors, strict=True)
    ]


def headline(meshes: Sequence[dict]) -> list[str]:
    """One sentence a mesh that is not the reference."""
    return [
        f"discretisation, {mesh['element']} at {mesh['size']:g} mm: W off by {100 * mesh['W_relative_max']:.1f} %, "
        f"tip by {mesh['tip_mm_max']:.2g} mm from the finest mesh"
        for mesh in meshes
        if mesh["W_relative_max"] > 0
    ]


def _beats(one: tuple, other: tuple) -> bool:
    return one[4] < other[4] and one[3].max() < other[3].max()


def _at(scene: SceneSpec, case: MeshCase) -> SceneSpec:
    ratio = case.size / scene.mesh.size
    refine = [part.model_copy(update={"size": part.size * ratio}) for part in scene.mesh.refine]
    mesh = scene.mesh.model_copy(update={"element": case.element, "size": case.size, "refine": refine})
    return scene.model_copy(update={"mesh": mesh})


def _solve(scene: SceneSpec, folder: Path, shares: Sequence[Sequence[float]]) -> tuple:
    """nodes, cells, tip (k, n_e), W of effector-actuator and actuator rows (k, n, n_a), median seconds of a
    state."""
    from cfem.equilibrium.actuation import pull
    from cfem.equilibrium.problem import Problem
    from cfem.equilibrium.solve import solve
    from cfem.robot.build import build_robot
    from cfem.robot.grading import scene_mesh

    mesh, _ = scene_mesh(scene, folder)
    robot = build_robot(scene, mesh)
    problem, state, tips, Ws, seconds = Problem(robot), None, [], [], []
    for share in shares:
        begin = time.perf_counter()
        found = solve(problem, pull(share, robot.reach[:, 1]), base=state)
        seconds.append(time.perf_counter() - begin)
        if not found.converged:
            raise NumericalError(f"discretisation, {scene.mesh.element} {scene.mesh.size:g} mm: {found.status.value}")
        state = found.state
        tips.append(found.delta_e)
        Ws.append(found.condensed.W[:, robot.rows.a])
    return len(mesh.X), len(mesh.cells), np.array(tips), np.array(Ws), float(np.median(seconds))


def discretisation_figure(results: Sequence[dict]) -> bytes:
    """Error of W and of the tip against seconds a state; the finest mesh, which has none, is left out."""
    from cfem.report.style import LEARNED, panels, png

    figure, axes = panels(2, height=3.5)
    elements = list(dict.fromkeys(row["element"] for row in results))
    for axis, key, scale, label in ((axes[0], "W_relative_max", 100.0, "%"), (axes[1], "tip_mm_max", 1.0, "mm")):
        for row in results:
            if row["W_relative_max"] == 0.0:
                continue
            colour = LEARNED[elements.index(row["element"]) % len(LEARNED)]
            first = all(other["element"] != row["element"] for other in results[: results.index(row)])
            axis.loglog(
                row["seconds"],
                scale * row[key],
                "o",
                ms=9,
                color=colour,
                mfc=colour if row["front"] else "white",
                label=row["element"] if first else None,
            )
            axis.annotate(
                f"{row['size']:g}",
                (row["seconds"], scale * row[key]),
                xytext=(6, 5),
                textcoords="offset points",
                fontsize=8,
            )
        axis.margins(0.35)
        axis.set(xlabel="one state (s)", ylabel=label)
    axes[0].legend(loc="lower left", title="mesh size (mm) beside each")
    axes[0].set_title("largest error of W (filled: on the front)")
    axes[1].set_title("largest error of the tip")
    return png(figure)
