"""How far W jumps where a design gets a mesh of its own instead of the morphed reference mesh.

    make finger-shapes && python benchmarks/remeshing.py pipelines/finger-shapes/sample.yaml --pull 8 8
    python benchmarks/remeshing.py pipelines/finger-shapes/sample.yaml --pull 8 8 --shares --beyond 2 3

Designs lie on a line from the reference to a corner of the ranges, and beyond where the morph reaches. Prints JSON, a
record a design: share of the way; smallest volume left of a morphed cell; W and tip on the morphed mesh against those
on the design's own mesh; and the own mesh's error by one of cells half as large. Errors of W in %, as in
many_inputs.py; of the tip in mm. --beyond: designs to which the morph does not reach, to which `cfem optimize-design`
gives meshes of their own: the jump where such a mesh takes over, as its results state it."""

import argparse
import json
from pathlib import Path

import numpy as np

from cfem.core.errors import NumericalError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.parametric.family import FiniteElementFamily
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.mesh.finer import finer_mesh
from cfem.sample.family import RobotFamily
from cfem.sample.parameters import scene_parameters, with_values
from cfem.sample.spec import SampleSpec


def answer(robot: Robot, pull: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """W (n, n) and delta_e (n_e,) mm."""
    found = solve(Problem(robot), displacement(pull), slack=False)
    if not found.converged:
        raise NumericalError(f"no equilibrium: {found.status.value}", where=robot.name)
    return found.condensed.W, found.delta_e


def apart(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> dict[str, float]:
    size = np.sqrt(np.diag(other[0]))
    scaled, true = (one[0] - other[0]) / np.outer(size, size), other[0] / np.outer(size, size)
    tip = float(np.linalg.norm(one[1] - other[1]))
    return {"W_percent": float(100 * np.linalg.norm(scaled) / np.linalg.norm(true)), "tip_mm": tip}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sample", type=Path)
    parser.add_argument("--pull", type=float, nargs="+", required=True)
    parser.add_argument("--shares", type=float, nargs="*", default=[0.0, 0.5, 1.0])
    parser.add_argument("--beyond", type=float, nargs="*", default=[])
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    spec, folder = load_spec(asked.sample, SampleSpec), asked.sample.parent
    scene, mesh = load_scene_and_mesh(folder / spec.scene, folder / spec.mesh)
    parameters = scene_parameters(spec.parameters, folder / spec.scene)
    family, keys = RobotFamily(scene, mesh, parameters), [one.key for one in parameters]
    reference = np.array([one.reference for one in parameters])
    up = np.random.default_rng(asked.seed).integers(0, 2, len(parameters)).astype(bool)
    corner = np.where(up, [one.high for one in parameters], [one.low for one in parameters])
    pull, found = np.array(asked.pull), []
    for share in asked.shares:
        p = reference + share * (corner - reference)
        here = with_values(scene, keys, p)
        own, *_ = scene_mesh(here, folder)
        mine = build_robot(here, own)
        finer = build_robot(here, finer_mesh(here, own, folder))
        answers = answer(mine, pull), answer(finer, pull)
        record = {"share": share, "cells": len(own.cells), "own_mesh_error": apart(*answers)}
        try:
            morphed = family.at(p)
            record["least_volume"] = float((morphed.body.mesh.volumes / mesh.volumes).min())
            record["jump"] = apart(answer(morphed, pull), answers[0])
            record["morphed_mesh_error"] = apart(answer(morphed, pull), answers[1])
        except NumericalError as error:
            record["refused"] = str(error)
        found.append(record)
    for share in asked.beyond:
        elements = FiniteElementFamily(scene, mesh, parameters, folder)
        try:
            elements.at("displacement", pull, (reference + share * (corner - reference))[None])
        except NumericalError as error:
            found.append({"share": share, "refused": str(error)})
            continue
        jumps = elements.jumps("displacement", pull)
        found.append({"share": share, "own_meshes": [{k: v for k, v in one.items() if k != "p"} for one in jumps]})
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
