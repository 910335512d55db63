"""Whether the stated error of a model holds. Usage: model_error.py [NAME ...] [--fresh N]. One JSON object a robot.

Each robot, of coarse cells where it is a solid, is sampled and trained as its pipeline says, with N more test states.
The model is calibrated on some of all test states in its domain, and asked about the others; that is repeated with
other ones, SPLITS times, for as many as the pipeline has and for MORE.

coverage: share of the other states whose error is within the bound: mean over the splits; of the quarters of them where
the effectors have moved least and most; ratio: bound to error, median; everywhere: the same of one bound for all
states; spread: standard deviation of the coverage over the splits.

moving-finger, moving-stiff-flop: each of their first natural frequencies, with the actuators held and free.
row: two modules of `stiff-flop-module` in a row. load: forces at the effectors, in random directions, for which the
estimate of the error is a share of what is trusted: true by estimate at 5, 50, 95 and 100 % of the states. loaded row:
the same of the row."""

import argparse
import json
import os
import shutil
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import cfem
from cfem.core.spec import load_spec
from cfem.dataset.reader import read_dataset
from cfem.equilibrium.system.robot import Robot
from cfem.motion.load import load_motion
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.load import build, load_model
from cfem.predict.loads.loaded import TRUSTED, loaded
from cfem.predict.protocol import Predictor
from cfem.predict.rows.serial import SerialPredictor
from cfem.predict.series.state_error import extrapolation
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.surrogate.calibration import answers, bound, calibrated, state_errors
from cfem.surrogate.motion_error import frequency_errors
from cfem.surrogate.spec import SpectralSpec, TrainSpec
from cfem.surrogate.stage import train_and_judge

PIPELINES = Path(__file__).parents[1] / "pipelines"
TENTACLE = {"scene": "scene.yaml", "mesh": "../../data/measured-tentacle/mesh", "out": "../../data/samples"}
TENTACLE["splits"] = {"train": {"rows": 60, "method": "scrambled-halton", "seed": 1}}
TENTACLE["splits"]["test"] = {"rows": 20, "method": "random", "seed": 2}
# name: pipeline, what its scene says otherwise
ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "bar": ("bar", {"mesh": {"size": "5 mm", "element": "hex8"}}),
    "pincer": ("pincer", {}),
    "stiff-flop module": ("stiff-flop-module", {}),
    "stiff-flop": ("stiff-flop", {}),
    "tentacle": ("measured-tentacle", {}),
    "pneunet": ("pneunet", {}),
    "soft finger": ("soft-finger", {"mesh": {"size": "12 mm", "cells": 500, "element": "tet10p0"}}),
    "trunk": ("trunk", {"mesh": {"size": "20 mm", "cells": 300, "element": "tet10p0"}}),
    "diamond": ("diamond", {"mesh": {"size": "30 mm", "cells": 300, "element": "tet10p0"}}),
}
MORE, SPLITS = 50, 200
MOVING = ("moving-finger", "moving-stiff-flop")
DOMAIN = 60  # states of the whole row that say where its domain is
LOADED, SHARES, DIRECTIONS, SEED = ("bar", "pincer", "stiff-flop module"), (0.03, 0.3, 0.9), 4, 4


def sampled(
    folder: Path, name: str, changes: dict[str, Any], fresh: int, training: int | None = None
) -> tuple[Path, Any, Any, int]:
    """Specs, training (so many, if not the pipeline's) and test states, and how many of these are the pipeline's."""
    specs = folder / "pipelines" / name
    shutil.copytree(PIPELINES / name, specs)
    scene = specs / "scene.yaml"
    scene.write_text(yaml.safe_dump({**yaml.safe_load(scene.read_text()), **changes}, sort_keys=False))
    path = specs / "sample.yaml"
    spec = TENTACLE if not path.exists() else yaml.safe_load(path.read_text())
    count = spec["splits"]["test"]["rows"]
    spec |= {"out": f"../../data/{name}/samples"}
    spec |= {} if name in MOVING else {"skin": None}  # its rows make the inner motions
    spec["splits"]["test"]["rows"] = count + fresh
    spec["splits"]["train"]["rows"] = training or spec["splits"]["train"]["rows"]
    path.write_text(yaml.safe_dump(spec, sort_keys=False))
    cfem.run_stage("mesh", scene)
    cfem.run_stage("sample", path, workers=1)
    data = folder / "data" / name / "samples"
    return specs, read_dataset(data / "train.parquet"), read_dataset(data / "test.parquet"), count


def judged(predictor: Predictor, test: Any, count: int) -> dict[str, Any]:
    """Coverage of states that took no part, for `count` and MORE states of calibration."""
    stated = calibrated(predictor, test)
    states, answered = answers(predictor, test, stated["command"])
    errors, L = (
        state_errors(predictor, states, test.take(answered), stated["command"]),
        extrapolation(predictor, states),
    )
    moved = np.linalg.norm(test.delta_e[answered][:, ~np.array(predictor.rows.turns)], axis=1)
    result = {
        "test_states": len(test),
        "in_domain": len(L),
        "powers": {n: round(stated[n]["power"], 1) for n in errors},
    }
    for n in sorted({count, MORE}):
        result[str(n)] = {name: split(values, L, moved, n) for name, values in errors.items() if n < len(L)}
    return result


def split(errors: np.ndarray, L: np.ndarray, moved: np.ndarray, n: int) -> dict[str, Any]:
    rng, rows, tiny = np.random.default_rng(0), [], np.finfo(float).tiny
    for _ in range(SPLITS):
        order = rng.permutation(len(L))
        mine, others = order[:n], order[n:]
        others, stated = others[np.argsort(moved[others])], bound(errors[mine], L[mine])
        true, most, quarter = np.maximum(errors[others], tiny), stated.at(L[others]), max(1, len(others) // 4)
        held, held_by_one = true <= most, true <= stated.everywhere
        shares = [values.mean() for values in (held, held[:quarter], held[-quarter:], held_by_one)]
        rows.append([*shares, np.median(most / true), np.median(stated.everywhere / true)])
    *coverages, ratio, ratio_of_one = np.array(rows).T
    coverage, near, far, by_one = (round(float(np.mean(values)), 3) for values in coverages)
    return {
        "coverage": coverage,
        "spread": round(float(np.std(coverages[0])), 3),
        "near": near,
        "far": far,
        "ratio": figure(np.median(ratio)),
        "everywhere": {"coverage": by_one, "ratio": figure(np.median(ratio_of_one))},
    }


def of_motion(name: str, folder: Path, fresh: int) -> dict[str, Any]:
    """The first natural frequencies of a robot that moves."""
    specs, _, test, count = sampled(folder, name, {}, fresh)
    cfem.run_stage("train", specs / "train.yaml", overrides=["learning_curve=[]"])
    model, data = load_motion(folder / "models" / name / "spectral"), folder / "data" / name / "samples"
    true = json.loads((data / "manifest.json").read_text())["results"]["frequencies"]
    states, answered = answers(model.static, test, "displacement")
    errors = frequency_errors(model, test.delta_a, true)[answered]
    stable = np.isfinite(errors).all(axis=(1, 2))
    L, moved = extrapolation(model.static, states)[stable], np.linalg.norm(test.delta_e[answered][stable], axis=1)
    of_kind = dict(zip(("held", "free"), errors[stable].transpose(1, 2, 0), strict=True))
    by_count = {
        str(n): {kind: [split(mode, L, moved, n) for mode in modes] for kind, modes in of_kind.items()}
        for n in sorted({count, MORE})
        if n < len(L)
    }
    return {
        "test_states": len(test),
        "stable_in_domain": len(L),
        "largest": errors[stable].max(axis=0).tolist(),
        "median": np.median(errors[stable], axis=0).tolist(),
    } | by_count


def figure(value: float) -> float:
    return float(f"{value:.2g}")


def robot(folder: Path, name: str, fresh: int) -> dict[str, Any]:
    pipeline, changes = ROBOTS[name]
    _, training, test, count = sampled(folder, pipeline, changes, fresh)
    path = PIPELINES / pipeline / "train.yaml"
    spec = load_spec(path, TrainSpec).model if path.exists() else SpectralSpec(kind="spectral")
    meta, arrays, results = train_and_judge(training, test, spec)
    largest = results["errors"]["tip_mm"]["max"]
    return {"samples": len(training), "largest_tip_mm": figure(largest), **judged(build(meta, arrays), test, count)}


def row(folder: Path, fresh: int) -> dict[str, Any]:
    """Two modules in a row: nothing of the whole was learned, and its test states judge."""
    model, test, count, _ = two_modules(folder, fresh)
    return {"samples": model.meta["modules"][0]["dataset"]["samples"], **judged(model, test, count)}


def two_modules(folder: Path, fresh: int) -> tuple[Predictor, Any, int, Robot]:
    """The model of the row, test states of the whole, how many of them are the pipeline's, and the FE robot."""
    specs, _, _, _ = sampled(folder, "stiff-flop-module", {}, 0)
    cfem.run_stage("train", specs / "train.yaml")
    whole, _, test, count = sampled(folder, "stiff-flop", {}, fresh, DOMAIN)
    cfem.run_stage("train", whole / "train-serial.yaml")
    fe = build_robot(*load_scene_and_mesh(whole / "scene.yaml"))
    return load_model(folder / "models" / "stiff-flop" / "serial"), test, count, fe


def load(folder: Path, fresh: int) -> dict[str, Any]:
    """Forces at the effectors that the samples did not carry: the model's own bound, and what it estimates of them."""
    return {name: under_forces(*unloaded(folder, name), fresh) for name in LOADED}


def loaded_row(folder: Path, fresh: int) -> dict[str, Any]:
    """The same of two modules in a row."""
    model, _, _, fe = two_modules(folder, 20 - 100)
    return under_forces(model, fe, fresh)


def unloaded(folder: Path, name: str) -> tuple[Predictor, Robot]:
    """The model of samples without loads, and the FE robot."""
    pipeline, changes = ROBOTS[name]
    specs = folder / "pipelines" / pipeline
    shutil.copytree(PIPELINES / pipeline, specs)
    scene = specs / "scene.yaml"
    scene.write_text(yaml.safe_dump({**yaml.safe_load(scene.read_text()), **changes}, sort_keys=False))
    asked = ["third_order=true", "loads=true", "splits.test.rows=30", "skin=null"]
    cfem.run_stage("mesh", scene)
    cfem.run_stage("sample", specs / "sample.yaml", overrides=asked, workers=1)
    cfem.run_stage("train", specs / "train.yaml", overrides=["samples=null"])
    return load_model(folder / "models" / pipeline / "spectral"), build_robot(*load_scene_and_mesh(scene))


def under_forces(model: Predictor, fe: Robot, fresh: int) -> dict[str, Any]:
    """Forces for which the estimate is a share of the error that is trusted. States in which a chamber of a row would
    have to be sucked at are left out: its wall buckles there."""
    of_row = isinstance(model, SerialPredictor)
    rng, forces, results = np.random.default_rng(SEED), [not turns for turns in model.rows.turns], {}
    for share in SHARES:
        true, estimated, at_state, held = [], [], [], []
        for _ in range(DIRECTIONS):
            found = estimated_at(model, np.where(forces, 1e-3 * rng.normal(size=model.rows.n_e), 0.0), share)
            plant = FemPlant(pushed(fe, np.array(found.meta["wrench"])))
            for place in rng.choice(model.trained, max(1, fresh // 16)):
                state = found.at_displacement(place)
                sucked = of_row and (state.lambda_a < 0).any()
                if (stated := found.error(state)).inside and not sucked:
                    away = state.delta_e - plant.at_displacement(state.delta_a).delta_e
                    true.append(np.linalg.norm(away[forces]))
                    estimated.append(found.meta["wrench_error"])
                    at_state.append(found.load_error(place))  # a bound
                    held.append(true[-1] <= stated.tip)
        quantiles = [np.quantile(np.array(true) / each, (0.05, 0.5, 0.95, 1.0)) for each in (estimated, at_state)]
        ratios = [[figure(value) for value in values] for values in quantiles]
        by = dict(zip(("true by estimate", "true by bound at the state"), ratios, strict=True))
        results[f"{100 * share:g} %"] = {"states": len(held), "coverage": float(np.mean(held)), **by}
    return results


def estimated_at(model: Predictor, wrench: np.ndarray, share: float) -> Predictor:
    """The model under so much of a wrench that the estimated error is this share of what is trusted."""
    for _ in range(3):  # the error goes with about its third power
        found = loaded(model, wrench, trusted=np.inf)
        wrench = wrench * (share * TRUSTED * model.length / found.meta["wrench_error"]) ** (1 / 3)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    special = {name: partial(of_motion, name) for name in MOVING} | {"row": row, "load": load, "loaded row": loaded_row}
    names = [*ROBOTS, *special]
    parser.add_argument("names", nargs="*", help=f"of {', '.join(names)}; all by default")
    parser.add_argument("--fresh", type=int, default=150)
    asked = parser.parse_args()
    for name in asked.names or names:
        begin = sum(os.times()[:4])
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            found = special[name](folder, asked.fresh) if name in special else robot(folder, name, asked.fresh)
        seconds = round(sum(os.times()[:4]) - begin, 1)  # of the CPU, also of processes started
        print(json.dumps({"robot": name, **found, "seconds": seconds}), flush=True)


if __name__ == "__main__":
    main()
