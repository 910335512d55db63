"""One learned model against FE-based control over many designs: where the FE robot of each design ends up.

    python benchmarks/designs.py geometric [--unseen 50]
    python benchmarks/designs.py geometric --losses
    python benchmarks/designs.py geometric --gradients
    python benchmarks/designs.py geometric --fronts

The designs that the paper names, 25 goals of the closing motion each, then random ones that no training has seen, five
goals each. Errors in mm and in % of the length 3 L of the scene's own robot; prints JSON.

--losses: in place of that, the paper's loss of our model and of the paper's networks G and F, on test designs at rest
and pulled, with the number of entries that vary there, the median of the rows' own losses and the share that the ten
worst rows have in the loss (after `make parametric-finger parametric-finger-paper`).

--gradients: in place of that, the gradients of the objectives of design.yaml at the named designs, by the model against
differences of fourth order of finite-element solves, relative to each gradient's length.

--fronts: in place of that, the designs that the paper calls best, or corners of its front, against the fronts of
design.yaml and design-one-point.yaml: objectives, and how many of the front's designs each dominates, and is by."""

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from cfem.condensed import entries
from cfem.condensed.parameters import shares
from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Pilot
from cfem.control.open_loop.experiment import follow
from cfem.control.search.goal_search import SearchSettings
from cfem.control.search.inverse import Limits
from cfem.control.task.design import designed
from cfem.control.task.goals.trajectory import arc
from cfem.core.artefact.content import artefact_file
from cfem.core.spec import load_spec
from cfem.dataset.reader import read_dataset
from cfem.design.formulation import problem_of
from cfem.design.spec import DesignSpec
from cfem.parametric.differences import Stencil
from cfem.parametric.load import finite_elements, learned
from cfem.plant.fem_plant import FemPlant
from cfem.predict.load import load_model
from cfem.robot.load import load_scene_and_mesh
from cfem.surrogate.error_measures import CONSTANT, paper_loss, sizes
from cfem.surrogate.stage import predictions

ROOT = Path(__file__).resolve().parents[1]
# Navez, Menager et al. 2025, table of the parametric finger: E (kPa), nu; L, H, JH (mm)
NAMED = {
    "mechanical": [(5000, 0.47), (1000, 0.45), (7000, 0.40), (3000, 0.47)],
    "geometric": [(40, 20, 6), (38.5, 21.5, 6), (40, 20.5, 7.5), (41, 21, 5.5), (39.5, 20, 7)],
}
# best dexterity, best strength, corners A to D of the front
BEST = [(38, 20.6, 6.3), (42, 22, 7.9), (38, 21.6, 5), (40.4, 20, 5.6), (40.2, 22, 7.4), (42, 22, 8)]
UNITS = {"mechanical": {"E": "kPa", "nu": ""}, "geometric": {"L": "mm", "H": "mm", "JH": "mm"}}
RANGES = {
    "mechanical": np.array([(1000, 10000), (0.4, 0.499)]),
    "geometric": np.array([(38, 42), (20, 22), (5, 8)]),
}


def track(kind: str, values: tuple[float, ...], goals: int) -> dict:
    """Largest and mean distance in the FE plant between what learned and FE-based control reach, mm."""
    scene, mesh = load_scene_and_mesh(
        ROOT / "pipelines/parametric-finger/scene.yaml", ROOT / "data/parametric-finger/mesh"
    )
    model = load_model(ROOT / f"models/parametric-finger/{kind}-export")
    asked = {name: f"{value} {unit}".strip() for (name, unit), value in zip(UNITS[kind].items(), values, strict=True)}
    robot, bound, shift = designed(scene, mesh, {"spectral": model}, asked)
    plant = FemPlant(robot)
    limits = Limits.of(robot.reach, robot.unilateral)
    ridge = ridge_of(1e-10, robot.reach, robot.length)
    points = arc(np.array([0, 10.5, 0]), 120.0, -np.pi / 2, 0.0, "yz", goals) + shift
    weights = np.ones(robot.rows.n_e)
    pilots = {
        name: Pilot(one, "displacement", "equilibrium", limits, weights, ridge, SearchSettings(20, tolerance, 5.0))
        for name, one, tolerance in (("fe-based", plant, 1e-4), ("spectral", bound["spectral"], 1e-5))
    }
    judge = "fe-based", Controller(pilots["fe-based"], robot.rest_e)
    done = [one for goal in follow(points, pilots, plant, robot.rest_e, judge) for one in goal]
    x = {
        name: np.array([one.measured.x_e for one in done if one.controller == name])
        for name in ("fe-based", "spectral")
    }
    apart = np.linalg.norm(x["spectral"] - x["fe-based"], axis=1)
    return {
        "design": asked,
        "mean_mm": float(apart.mean()),
        "max_mm": float(apart.max()),
        "max_percent": float(100 * apart.max() / robot.length),
        "travel_mm": float(np.linalg.norm(x["fe-based"] - robot.rest_e, axis=1).max()),
    }


def losses(kind: str) -> dict:
    """By model, and by test rows: at rest those of {kind}-rest, pulled those of {kind}."""
    rows = {
        name: read_dataset(artefact_file(ROOT / f"data/parametric-finger/{kind}{folder}", "test.parquet"))
        for name, folder in (("at_rest", "-rest"), ("pulled", ""))
    }
    found = {}
    for name, on in (("export", list(rows)), ("g", ["at_rest"]), ("f", list(rows))):
        model = load_model(ROOT / f"models/parametric-finger/{kind}-{name}")
        found[name] = {"kind": model.meta["kind"], "samples": model.meta["dataset"]["samples"]}
        for which in on:
            test = rows[which]
            predicted = predictions(model, test)
            rows_alone = row_losses(entries(test.W, test.delta_free), entries(*predicted), test.rows.n)
            found[name][which] = paper_loss(test.W, test.delta_free, *predicted) | {
                "median_row": float(np.median(rows_alone)),
                "share_of_worst_ten": float(np.sort(rows_alone)[-10:].sum() / rows_alone.sum()),
            }
    return found


def row_losses(true: np.ndarray, model: np.ndarray, n: int) -> np.ndarray:
    """(m,) of entries (m, k), whose mean is the paper's loss."""
    deviation = true.std(axis=0)
    varies = deviation > CONSTANT * sizes(true, n)
    return (((model - true)[:, varies] / deviation[varies]) ** 2).mean(axis=1)


def gradients() -> dict:
    """Largest error at each of the named designs, by objective."""
    folder = ROOT / "pipelines/parametric-finger"
    spec = load_spec(folder / "design.yaml", DesignSpec)
    model, scene, mesh = (folder / path for path in (spec.model, spec.scene, spec.mesh))
    problem, _ = problem_of(spec, learned(model, scene), scene, folder)
    exact = replace(problem, family=finite_elements(scene, mesh, problem.family.parameters))
    found = {}
    for p in NAMED["geometric"]:
        z = shares(problem.family.parameters, np.array([p], float))[0]
        (_, mine), (_, fe) = problem.with_slopes(z), exact.with_slopes(z, Stencil(4, 0.02))
        off = np.linalg.norm(mine - fe, axis=1) / np.linalg.norm(fe, axis=1)
        found[str(p)] = dict(zip(problem.names, off.tolist(), strict=True))
    return found


def fronts() -> dict:
    """By spec and design."""
    folder, found = ROOT / "pipelines/parametric-finger", {}
    for name in ("design", "design-one-point"):
        spec = load_spec(folder / f"{name}.yaml", DesignSpec)
        problem, _ = problem_of(spec, learned(folder / spec.model, folder / spec.scene), folder / spec.scene, folder)
        table = pq.read_table(artefact_file(folder / spec.out, "front.parquet"))
        front = np.column_stack([table[f"objective.{one}"].to_numpy() for one in spec.front.of])
        for p in BEST:
            z = shares(problem.family.parameters, np.array([p], float))
            here = problem(z).objectives[0, [problem.names.index(one) for one in spec.front.of]]
            found[f"{name} {p}"] = {
                "objectives": here.tolist(),
                "dominates": int(((here <= front).all(axis=1) & (here < front - 1e-9).any(axis=1)).sum()),
                "dominated_by": int(((front <= here).all(axis=1) & (front < here - 1e-9).any(axis=1)).sum()),
            }
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=list(NAMED))
    parser.add_argument("--unseen", type=int, default=50)
    parser.add_argument("--losses", action="store_true")
    parser.add_argument("--gradients", action="store_true")
    parser.add_argument("--fronts", action="store_true")
    given = parser.parse_args()
    if given.losses or given.gradients or given.fronts:
        found = losses(given.kind) if given.losses else gradients() if given.gradients else fronts()
        print(json.dumps(found, indent=1))
        return
    low, high = RANGES[given.kind].T
    random = low + np.random.default_rng(7).random((given.unseen, len(low))) * (high - low)
    designs = [(given.kind, one, 25) for one in NAMED[given.kind]]
    designs += [(given.kind, tuple(float(f"{value:.6g}") for value in one), 5) for one in random]
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as executor:
        done = list(executor.map(track, *zip(*designs, strict=True)))
    named, unseen = done[: len(NAMED[given.kind])], done[len(NAMED[given.kind]) :]
    worst = max(unseen, key=lambda one: one["max_mm"], default=None)
    print(json.dumps({"named": named, "unseen": len(unseen), "worst_unseen": worst}, indent=1))


if __name__ == "__main__":
    main()
