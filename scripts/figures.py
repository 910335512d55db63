"""Gathers the figures of README.md and of docs/*.md from artefacts and benchmarks, or writes them there.

figures.py measure PART ...   finger, other_robot, surrogates, contact, tours, stability, convergence, discretisation:
                              into docs/figures.json, and, once all are there, the tables between the marks of the files
figures.py write              the tables alone"""

import json
import subprocess
import sys
import time
from pathlib import Path

from figure_tables import TABLES

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "docs" / "figures.json"
# The paper's three meshes, by the size of linear tetrahedra that comes near.
PAPER = ("7.7 mm", "2.95 mm", "2.2 mm")
TOUR = {"rslab": 1000, "pardiso": 300}  # samples


def measure_finger() -> dict:
    """Everything the first table needs, from files that the pipelines made and from three short runs."""
    control = results("data/soft-finger/control-large")["trajectories"]
    spectral, mlp = (results(f"models/soft-finger/{name}") for name in ("spectral-large", "mlp"))
    samples, tet4 = results("data/soft-finger/samples-large"), results("data/soft-finger-tet4/samples")
    reach = control["closed-curve"]
    arc = control["quarter-circle"]
    return {
        "verification": run("benchmarks/verification.py", "pipelines/soft-finger/scene-large.yaml"),
        "samples": {key: samples[key] for key in ("rows", "failed", "residual_max", "factorizations_per_sample")},
        "tet4": {key: tet4[key] for key in ("samples_per_second_per_core", "factorizations_per_sample")},
        "tet4_cells": results("data/soft-finger-tet4/mesh")["cells"],
        "learning_curve": {str(row["samples"]): row["errors"]["loss"] for row in spectral["learning_curve"]},
        "spectral": model_figures(spectral),
        "mlp": model_figures(mlp),
        "closed_curve": {name: reach[name]["distance_to_reachable_goals"] for name in ("fe-based", "spectral", "mlp")},
        "quarter_circle": {name: arc[name]["distance_to_fe_based"] for name in ("spectral", "mlp")},
        "reachable": [arc["fe-based"]["reachable"], arc["fe-based"]["goals"]],
        "process": run("benchmarks/control_process.py", "models/soft-finger/spectral-large-export"),
        "help_seconds": min(timed([sys.executable, "-m", "cfem", "--help"]) for _ in range(5)),
    }


def measure_other_robot() -> dict:
    """Tracking errors (mm) of the demo's model in a robot that differs from it, in an open and a closed loop."""
    loop = results("data/soft-finger/control-other-robot")["loop"]["closed-curve"]
    return {name: {key: loop[name]["error_at_goals"][key] for key in ("mean", "max")} for name in ("open", "closed")}


def measure_surrogates() -> dict:
    """What `make surrogates` trained: a record a robot, model and number of samples."""
    found = {}
    for manifest in sorted((ROOT / "models" / "surrogates").glob("[a-z]*/[a-z]*/manifest.json")):
        robot, model = manifest.parts[-3:-1]
        trained = results(f"models/surrogates/{robot}/{model}")
        found.setdefault(robot, {})[model] = {
            "definite": trained["positive_definite"]["share"],
            "curve": [surrogate_point(point) for point in trained["learning_curve"]],
        }
    found.pop("meshes", None)
    meshes = {
        folder.name: {
            "cells": results(f"data/surrogates/meshes/{folder.name}/mesh")["cells"],
            "curve": [surrogate_point(point) for point in results(str(folder.relative_to(ROOT)))["learning_curve"]],
        }
        for folder in sorted((ROOT / "models" / "surrogates" / "meshes").glob("[0-9]*"))
    }
    return {"robots": found, "meshes": meshes}


def measure_contact() -> dict:
    """What `make finger-button`, `make soft-gripper` and `make finger-rod` made."""
    found = {}
    for scene in ("finger-button", "soft-gripper", "finger-rod"):
        control, model = results(f"data/{scene}/control"), results(f"models/{scene}/spectral")
        keys = ("distance_to_reachable_goals", "distance_to_fe_based", "goals", "reachable", "step_us")
        found[scene] = {
            "curve": [surrogate_point(point) for point in model["learning_curve"]],
            "definite": model["positive_definite"]["share"],
            "query_us": model["microseconds_query"],
            "object": control["object"],
            "trajectories": {
                name: {one: {key: row[key] for key in keys} for one, row in controllers.items()}
                for name, controllers in control["trajectories"].items()
            },
        }
    return {"held": found}


def surrogate_point(point: dict) -> dict:
    errors = point["errors"]
    return {
        "samples": point["samples"],
        "loss": errors["loss"],
        "tip_mm": errors["tip_mm"]["max"],
        "tip_percent": errors["tip_percent_of_length"]["max"],
        "force_N": errors["force_N"]["max"],
        "fit_seconds": point["seconds_fit"],
        "sampling_seconds": point["seconds_sampling"],
        "query_us": point["microseconds_query"],
    }


def measure_tours() -> dict:
    """Of the paper's meshes and of the scene's own, by both solvers; some fifteen minutes of one core."""
    finger, tet4 = (f"pipelines/{name}.yaml" for name in ("soft-finger/scene-large", "soft-finger-tet4/scene"))
    return {
        "paper": [tour(tet4, count, solver, f"mesh.size={size}") for size in PAPER for solver, count in TOUR.items()],
        "own": [tour(finger, 100, "rslab"), tour(finger, 300, "rslab", "material.poisson=0.499")],
        "large": tour(tet4, 12, "rslab", "mesh.size=1.2 mm"),
    }


def measure_stability() -> dict:
    suite = run("-m", "cfem", "stability", "--json")
    return {
        "cases": suite["cases"],
        "right": suite["cases"] - len(suite["misbehaving"]),
        "seconds": suite["seconds"],
    }


PARTS = {
    "finger": measure_finger,
    "other_robot": measure_other_robot,
    "surrogates": measure_surrogates,
    "contact": measure_contact,
    "tours": measure_tours,
    "stability": measure_stability,
    "convergence": lambda: run("benchmarks/convergence.py"),
    "discretisation": lambda: results("data/soft-finger/discretisation")["discretisation"],
}


def tour(scene: str, samples: int, solver: str, *overrides: str) -> dict:
    print(f"tour of {samples}: {scene} {solver} {' '.join(overrides)}", file=sys.stderr)
    return run("benchmarks/tour.py", scene, str(samples), *overrides, "--solver", solver)


def model_figures(result: dict) -> dict:
    errors = result["errors"]
    picked = {name: errors[name]["max"] for name in ("tip_mm", "force_N")}
    return {"samples": result["samples"], "seconds": result["seconds_fit"], "loss": errors["loss"], **picked}


def results(folder: str) -> dict:
    return json.loads((ROOT / folder / "manifest.json").read_text())["results"]


def run(script: str, *words: str) -> dict:
    done = subprocess.run([sys.executable, script, *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def timed(command: list[str]) -> float:
    begin = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - begin


FILES = ("README.md", "docs/figures.md", "docs/mechanics.md", "docs/figures/surrogates.md", "docs/figures/gripping.md")


def with_tables(text: str, figures: dict) -> str:
    """Every table whose marks are in the text, put between them."""
    for name, table in TABLES.items():
        begin, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        if begin in text:
            head, rest = text.split(begin)
            text = f"{head}{begin}\n{table(figures)}\n{end}{rest.split(end)[1]}"
    return text


def main(what: str, *parts: str) -> None:
    for part in parts:
        found = PARTS[part]()  # read the file late: another part may have been measured meanwhile
        FIGURES.write_text(json.dumps({**json.loads(FIGURES.read_text()), part: found}, indent=1) + "\n")
    figures = json.loads(FIGURES.read_text())
    if what == "write" or set(PARTS) <= set(figures):
        for name in FILES:
            path = ROOT / name
            path.write_text(with_tables(path.read_text(), figures))


if __name__ == "__main__":
    main(*sys.argv[1:])
