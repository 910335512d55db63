"""How far the cable of the parametric finger can be pulled before a bellow snaps through, by law and element.

    python benchmarks/cable_reach.py [--quick]

Prints JSON: cells, force (N) and tip (mm, along y) by pull (mm), in steps of half a mm, and the first pull that is not
stable (None: all are). --quick: the coarsest mesh and the first pulls alone, to see that it runs."""

import json
import sys
from pathlib import Path

import numpy as np

from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec

SCENE = Path(__file__).resolve().parents[1] / "pipelines/parametric-finger/scene.yaml"
CASES = {
    "neo-Hookean, tet10p0": [],
    "corotational, tet10p0": ["material.law=corotational"],
    "corotational, coarse tet4": ["material.law=corotational", "mesh={size: 9 mm, element: tet4}"],
}
PLACES = (5.0, *np.arange(10, 20.5, 0.5).tolist())


def reach(overrides: list[str], places: tuple[float, ...]) -> dict:
    scene = load_spec(SCENE, SceneSpec, overrides)
    mesh, *_ = scene_mesh(scene, SCENE.parent)
    problem, state, found = Problem(build_robot(scene, mesh)), None, {"cells": len(mesh.cells), "lost": None}
    found |= {"N": {}, "tip_mm": {}}
    for place in places:
        here = solve(problem, displacement(np.array([place])), state)
        if not here.converged:
            return {**found, "lost": place}
        state = here.state
        found["N"][place], found["tip_mm"][place] = round(float(here.lambda_a[0]), 3), round(float(here.delta_e[1]), 3)
    return found


if __name__ == "__main__":
    quick = "--quick" in sys.argv[1:]
    cases, places = (list(CASES)[-1:], PLACES[:2]) if quick else (list(CASES), PLACES)
    print(json.dumps({name: reach(CASES[name], places) for name in cases}, indent=1))
