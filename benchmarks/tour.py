"""Where the time of a sample goes: a tour of samples of a scene, in this process; prints one JSON object.

Usage: tour.py SCENE_YAML SAMPLES [KEY=VALUE ...] [--solver NAME], e.g. tour.py scene.yaml 1000 mesh.size="3 mm"

`bound` is the time of the numeric factorisations alone; seconds are of the process (CPU), on one thread."""

import argparse
import json
import os
import resource
import time
from collections import defaultdict
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np

from cfem.core.spec import load_spec
from cfem.equilibrium import condensation, newton, predictor, solve
from cfem.equilibrium.system import problem
from cfem.equilibrium.system.actuation import force
from cfem.mechanics import factorization
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.plan import actuation, shards, skeleton, unit_rows
from cfem.sample.spec import SampleSpec, SplitSpec


class Clock:
    """Seconds by name of whatever it wraps; nested calls are counted once, by the innermost."""

    def __init__(self):
        self.seconds, self.calls, self._inner = defaultdict(float), defaultdict(int), [0.0]

    def wrap(self, name, function):
        def timed(*args, **kwargs):
            self._inner.append(0.0)
            begin = time.process_time()
            try:
                return function(*args, **kwargs)
            finally:
                took = time.process_time() - begin
                self.seconds[name] += took - self._inner.pop()
                self.calls[name] += 1
                self._inner[-1] += took

        return timed


def watch(clock: Clock) -> None:
    """Puts the clock around the parts of a solve."""
    for owner, attribute, name in (
        (problem.Problem, "evaluate", "forces and constraints"),
        (problem.Problem, "stiffness", "stiffness assembly"),
        (newton, "_correct", "corrections"),
        (condensation, "refined", "condensation"),
        (condensation, "symmetric_product", "condensation"),
        (predictor, "predict", "prediction"),
        (predictor, "knot", "prediction"),
    ):
        setattr(owner, attribute, clock.wrap(name, getattr(owner, attribute)))
    build = dict(factorization.SOLVERS)

    def timed(solver):
        def analyze(pattern):
            numeric = clock.wrap("numeric factorisation", build[solver](pattern))

            def factor(data):
                found = numeric(data)
                return factorization.Factor(clock.wrap("triangular solves", found.solve), found.negative)

            return factor

        return analyze

    factorization.SOLVERS.update({name: timed(name) for name in build})


def run(scene: Path, samples: int, overrides: list[str]) -> dict:
    spec = load_spec(scene, SceneSpec, overrides)
    robot = build_robot(spec, scene_mesh(spec, scene.parent)[0])
    clock = Clock()
    watch(clock)
    begin = time.process_time()
    fe = problem.Problem(robot)
    rest = solve.solve(fe, force(np.zeros(robot.rows.n_a)))  # also compiles what is not cached
    compliance = rest.condensed.W_aa
    setup = time.process_time() - begin
    clock.seconds.clear(), clock.calls.clear()
    plan = SampleSpec(scene=scene, mesh=scene, out=scene, splits={"train": SplitSpec(rows=samples, method="random")})
    u = unit_rows(plan.splits["train"], robot.rows.n_a)
    first = skeleton(u, plan.skeleton)
    pieces = shards(u, np.setdiff1d(np.arange(len(u)), first), plan.shard)
    begin, solved = time.process_time(), []

    def walk(rows, known):
        knots = list(known)
        for row in rows:
            asked = actuation("pulling", u[row], robot.reach, compliance)
            found = solve.solve(fe, asked, predictor.predict(knots, u[row], asked))
            solved.append(found)
            if found.converged:
                knots.append(predictor.knot(u[row], found))
        return knots

    states = walk(first, [])
    for rows in pieces:
        walk(rows, states)
    total = time.process_time() - begin
    parts = dict(clock.seconds)
    parts["the rest"] = total - sum(parts.values())
    return {
        "scene": spec.name,
        "element": spec.mesh.element,
        "solver": factorization.solver_name(),
        "cells": len(fe.body.cells),
        "unknowns": fe.pattern.n_dof,
        "samples": samples,
        "failed": sum(not found.converged for found in solved),
        "samples_per_second": samples / total,
        "factorizations_per_sample": float(np.mean([found.factorizations for found in solved])),
        "time_over_bound": total / parts["numeric factorisation"],
        "ms_per_sample": {
            name: 1e3 * seconds / samples for name, seconds in sorted(parts.items(), key=lambda p: -p[1])
        },
        "setup_seconds": setup,
        "residual": max(found.residual for found in solved if found.converged),
        "memory_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scene", type=Path)
    parser.add_argument("samples", type=int)
    parser.add_argument("overrides", nargs="*")
    parser.add_argument("--solver", choices=sorted(factorization.SOLVERS))
    arguments = parser.parse_args()
    if arguments.solver:
        os.environ["CFEM_SOLVER"] = arguments.solver
    print(json.dumps(run(arguments.scene, arguments.samples, arguments.overrides), indent=1))
