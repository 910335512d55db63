"""One learned model against FE-based control over many designs: where the FE robot of each design ends up.

    python benchmarks/designs.py geometric [--unseen 50]
    python benchmarks/designs.py geometric --losses

The designs that the paper names, 25 goals of the closing motion each, then random ones that no training has seen, five
goals each. Errors in mm and in % of the length 3 L of the scene's own robot; prints JSON.

--losses: in place of that, the paper's loss of our model and of the paper's networks G and F, on test designs at rest
and pulled, with the number of entries that vary there (after `make parametric-finger parametric-finger-paper`)."""

import argparse
import json
from pathlib import Path

import numpy as np

from cfem.control.design import designed
from cfem.control.experiment import Controller, Tracker, follow
from cfem.control.fem_plant import FemPlant
from cfem.control.inverse import Limits, ridge_of
from cfem.control.loop import Settings
from cfem.control.trajectory import arc
from cfem.core.stage import artefact_file
from cfem.dataset.reader import read_dataset
from cfem.predict.load import load_model
from cfem.robot.load import load_scene_and_mesh
from cfem.surrogate.error_measures import paper_loss
from cfem.surrogate.stage import predictions

ROOT = Path(__file__).resolve().parents[1]
# Navez, Menager et al. 2025, table of the parametric finger: E (kPa), nu; L, H, JH (mm)
NAMED = {
    "mechanical": [(5000, 0.47), (1000, 0.45), (7000, 0.40), (3000, 0.47)],
    "geometric": [(40, 20, 6), (38.5, 21.5, 6), (40, 20.5, 7.5), (41, 21, 5.5), (39.5, 20, 7)],
}
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
    settings = Settings(20, 1e-5, 5.0)
    exact = Settings(20, 1e-4, 5.0)
    points = arc(np.array([0, 10.5, 0]), 120.0, -np.pi / 2, 0.0, "yz", goals) + shift
    reference = Controller("fe-based", plant, exact, exact)
    learned = [Controller("spectral", bound["spectral"], settings, settings)]
    weights = np.ones(robot.rows.n_e)
    done = follow(points, reference, learned, plant, lambda one: Tracker(one, limits, weights, ridge, robot.rest_e))
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
            found[name][which] = paper_loss(test.W, test.delta_free, *predictions(model, test))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=list(NAMED))
    parser.add_argument("--unseen", type=int, default=50)
    parser.add_argument("--losses", action="store_true")
    given = parser.parse_args()
    if given.losses:
        print(json.dumps(losses(given.kind), indent=1))
        return
    low, high = RANGES[given.kind].T
    random = low + np.random.default_rng(7).random((given.unseen, len(low))) * (high - low)
    named = [track(given.kind, one, 25) for one in NAMED[given.kind]]
    unseen = [track(given.kind, tuple(float(f"{value:.6g}") for value in one), 5) for one in random]
    worst = max(unseen, key=lambda one: one["max_mm"], default=None)
    print(json.dumps({"named": named, "unseen": len(unseen), "worst_unseen": worst}, indent=1))


if __name__ == "__main__":
    main()
