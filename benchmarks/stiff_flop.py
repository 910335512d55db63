"""The pneumatic trunk's models against each other: `python benchmarks/stiff_flop.py rest | bending | solid [--quick]`.

rest: compliance of the tip at rest, and CPU seconds of a solve with W from rest to 100 kPa in one pair of each module.
bending: tips under random pressures up to 200 kPa, hexahedra of several lengths against the rod.
solid: `mesh.element: hex8`, a 3-D solid of 20 layers a module whose chambers are wound with hoops, one a layer, while
the rest of a section may deform, and whose modules end in plates: against the rod, and against a rod whose fibres
contract sideways freely (E instead of lambda + 2 mu).
--quick: two layers a module and one state, to see that it runs."""

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).parents[1] / "pipelines" / "stiff-flop" / "scene.yaml"
POISSON, LENGTH = 0.15, 55.0
QUICK = "--quick" in sys.argv[2:]
PRESSURES = 0.2 * np.random.default_rng(0).random((1 if QUICK else 8, 6))


def trunk(element: str, slices: int, law: str = "corotational") -> Problem:
    laws = [f"material.law={law}", f"materials.0.material.law={law}"]
    scene = load_spec(SCENE, SceneSpec, [f"mesh.element={element}", f"mesh.size={LENGTH / slices!r} mm", *laws])
    return Problem(build_robot(scene, make_mesh(scene, SCENE.parent)[0]))


def contracting_rod(slices: int) -> Problem:
    robot = trunk("beam", slices).robot
    axial = (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
    stiffness = robot.body.rod.stiffness / [axial, 1, 1, 1, axial, axial]
    return Problem(replace(robot, body=replace(robot.body, rod=replace(robot.body.rod, stiffness=stiffness))))


def tip(problem: Problem, pressures: np.ndarray) -> np.ndarray:
    """(3,) mm, NaN where there is no equilibrium."""
    solved = solve(problem, force(pressures), wanted=Wanted(condense=False))
    return solved.delta_e if solved.converged else np.full(3, np.nan)


def rest() -> None:
    print("element, slices a module: tip compliance mm/mN, in the limit 4.4768, W_aa mm^3/kPa, iterations, CPU s")
    layers, sections = ((2,), (2,)) if QUICK else ((10, 16, 20), (10, 20))
    hexahedra = [(e, n) for e in ("hex8-full", "hex8-reduced") for n in layers]
    for element, slices in [*hexahedra, *(("beam", n) for n in sections)]:
        problem = trunk(element, slices)
        W = 1e-3 * solve(problem, force(np.zeros(6))).condensed.W
        begin = time.process_time()
        solved = solve(problem, force([0.1, 0, 0, 0.1, 0, 0]))
        seconds = time.process_time() - begin
        print(f"{element} {slices}: {W[1, 1]:.4f}  {W[3, 3]:.4f} {W[6, 6]:.4f}  {solved.iterations}  {seconds:.3f}")


def bending() -> None:
    rod = trunk("beam", 20)
    exact = np.array([tip(rod, each) for each in PRESSURES])
    moved = np.linalg.norm(exact, axis=1)
    layers = (2,) if QUICK else (10, 20)
    print(f"rod: the tips move by {moved.min():.1f} to {moved.max():.1f} mm")
    for element, slices in [*((e, n) for e in ("hex8-full", "hex8-reduced") for n in layers), ("beam", 1)]:
        problem = trunk(element, slices)
        apart = np.linalg.norm([tip(problem, each) - one for each, one in zip(PRESSURES, exact, strict=True)], axis=1)
        print(f"{element} {slices}: off by mean {np.mean(apart):.2g}, max {np.max(apart):.2g} mm")


def compare_solid() -> None:
    rods = {"rod": trunk("beam", 20), "rod that contracts": contracting_rod(20)}
    for law in ("corotational", "neo-hookean-log"):
        problem = trunk("hex8", 2 if QUICK else 20, law)
        W = 1e-3 * solve(problem, force(np.zeros(6))).condensed.W
        print(f"solid, {law}: tip compliance at rest {W[1, 1]:.4f} mm/mN, W_aa {W[3, 3]:.4f} {W[6, 6]:.4f} mm^3/kPa")
        for share in (0.25,) if QUICK else (0.25, 0.5, 1.0):
            tips = np.array([tip(problem, share * each) for each in PRESSURES[:4]])
            moved = np.linalg.norm(tips, axis=1)
            for name, other in rods.items():
                apart = np.linalg.norm(
                    [tip(other, share * p) - t for p, t in zip(PRESSURES, tips, strict=False)], axis=1
                )
                text = ", ".join(f"{one:.2f} of {all_:.1f}" for one, all_ in zip(apart, moved, strict=True))
                print(f"  to {200 * share:g} kPa, {name}: off by {text} mm", flush=True)


if __name__ == "__main__":
    {"rest": rest, "bending": bending, "solid": compare_solid}[sys.argv[1]]()
