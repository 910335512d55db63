"""Which kind of model holds to how many design inputs, at what cost: errors on designs that no training has seen.

    make finger-shapes && python benchmarks/many_inputs.py finger --states 100 200 400 600
    python benchmarks/many_inputs.py bar --inputs 5 10 15 20 --states 300

finger: the dataset of pipelines/finger-shapes: two cables, five lengths, two routings and five control points. bar: a
bar of one cable with as many control points as it takes, sampled here (seconds to minutes).

Prints JSON, one record a model: kind; inputs (actuators and parameters); states: of FE in the training; error of the
effector in % of the length and of W in %, each mean, 95 % quantile and largest over the test states; fit_seconds and
seconds_10000_designs of CPU time (one core); terms of the series. The error of W is the Frobenius norm of its error
relative to that of W, both with rows and columns divided by the roots of W's diagonal, so that units do not matter."""

import argparse
import json
import tempfile
import time
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from cfem.condensed.parameters import completed
from cfem.core.artefact.content import artefact_file
from cfem.core.stage import Options
from cfem.dataset.reader import Dataset, read_dataset
from cfem.predict.array_predictor import build
from cfem.robot.stage import run as make_mesh
from cfem.sample.stage import run as simulate_sample
from cfem.surrogate.model_card import model_card
from cfem.surrogate.spec import ModelSpec
from cfem.surrogate.stage import fit_of, predictions

ROOT = Path(__file__).resolve().parents[1]
KINDS = {
    "spectral": {"kind": "spectral", "max_terms": 700},
    "spectral-300": {"kind": "spectral", "max_terms": 300},
    "spectral-2000": {"kind": "spectral", "max_terms": 2000},
    "mlp": {"kind": "mlp", "epochs": 1500},
}
DESIGNS = 10_000
SCENE = """
name: bar
out: mesh
length: 60 mm
geometry: {{kind: bar, length: 60 mm, width: 10 mm, height: 10 mm}}
shape: {{controls: [{controls}]}}
mesh: {{size: 8 mm, element: tet10p0}}
material: {{law: neo-hookean, young: 1 MPa, poisson: 0.45}}
fixed: [{{kind: plane, point: {{mm: [1, 0, 0]}}, normal: [-1, 0, 0]}}]
actuators:
  - kind: cable
    name: up
    points: {{mm: [[15, 0, 3], [35, 0, 3], [55, 0, 3]]}}
    pull_point: {{mm: [0, 0, 3]}}
    reach: {{mm: [0, 6]}}
effectors: [{{name: tip, point: {{mm: [58, 0, 0]}}}}]
"""


def bar(inputs: int, states: int, tests: int, folder: Path) -> tuple[Dataset, Dataset]:
    """Sampled states for training and for tests, of a bar with inputs - 1 control points above, below and beside it."""
    places = np.linspace(8, 52, inputs - 1)
    faces = [("[{x}, 0, 5]", 2, ""), ("[{x}, 0, -5]", 2, ""), ("[{x}, 5, 0]", 1, ", mirror: y")]
    controls, parameters = [], {}
    for number, x in enumerate(places):
        at, axis, mirror = faces[number % 3]
        controls.append(f"{{at: {{mm: {at.format(x=round(x, 3))}}}, move: {{mm: [0, 0, 0]}}, radius: 14 mm{mirror}}}")
        parameters[f"m{number}"] = {"key": f"shape.controls.{number}.move.{axis}", "range": {"mm": [-0.8, 0.8]}}
    sample = {
        "scene": "scene.yaml",
        "mesh": "mesh",
        "out": "samples",
        "third_order": True,
        "parameters": parameters,
        "splits": {
            "train": {"rows": states, "method": "scrambled-halton", "seed": 1},
            "test": {"rows": tests, "method": "random", "seed": 2},
        },
    }
    (folder / "scene.yaml").write_text(SCENE.format(controls=", ".join(controls)))
    (folder / "sample.yaml").write_text(json.dumps(sample))
    quiet = Options(quiet=True)
    make_mesh(folder / "scene.yaml", [], None, quiet)
    simulate_sample(folder / "sample.yaml", [], None, quiet, workers=1)
    return both(folder / "samples")


def both(folder: Path) -> tuple[Dataset, Dataset]:
    return tuple(read_dataset(artefact_file(folder, f"{split}.parquet")) for split in ("train", "test"))


def measure(name: str, training: Dataset, test: Dataset) -> dict:
    """One record."""
    spec = TypeAdapter(ModelSpec).validate_python(KINDS[name])
    begin = time.process_time()
    arrays, facts, _ = fit_of(spec)(training, spec, None)
    fitted = time.process_time() - begin
    predictor = build(model_card(spec.kind, training, **facts), arrays)
    W, free = predictions(predictor, test)
    e, a = test.rows.e, test.rows.a
    lam = np.linalg.solve(W[:, a, a], (test.delta_a - free[:, a])[..., None])
    off = (W[:, e, a] @ lam)[..., 0] + free[:, e] - test.delta_e
    many = np.random.default_rng(0).integers(len(test), size=DESIGNS)
    s, p = test.delta_a[many], completed(predictor.parameters, test.p)[many]
    begin = time.process_time()
    predictor.evaluate(s, p)
    evaluated = time.process_time() - begin
    return {
        "kind": name,
        "inputs": predictor.n_inputs,
        "states": len(training),
        "tip_percent": statistics(100 * np.linalg.norm(off, axis=1) / float(test.meta["length"])),
        "W_percent": statistics(100 * relative(W, test.W)),
        "fit_seconds": round(fitted, 2),
        "seconds_10000_designs": round(evaluated, 2),
        "terms": facts.get("terms"),
        "smallest_eigenvalue": float(np.linalg.eigvalsh(scaled(W, W))[:, 0].min()),
    }


def scaled(W: np.ndarray, by: np.ndarray) -> np.ndarray:
    """(m, n, n) with rows and columns divided by the roots of the diagonal of `by`."""
    size = np.sqrt(np.abs(np.einsum("mii->mi", by)))
    return W / size[:, :, None] / size[:, None, :]


def relative(W: np.ndarray, true: np.ndarray) -> np.ndarray:
    """(m,)."""
    return np.linalg.norm(scaled(W - true, true), axis=(1, 2)) / np.linalg.norm(scaled(true, true), axis=(1, 2))


def statistics(values: np.ndarray) -> dict[str, float]:
    found = {"mean": values.mean(), "q95": np.quantile(values, 0.95), "max": values.max()}
    return {name: float(f"{value:.3g}") for name, value in found.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("robot", choices=["finger", "bar"])
    parser.add_argument("--inputs", type=int, nargs="+", default=[5, 10, 15, 20])
    parser.add_argument("--states", type=int, nargs="+", default=[300])
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=["spectral"])
    parser.add_argument("--tests", type=int, default=100)
    parser.add_argument("--quick", action="store_true")
    asked = parser.parse_args()
    if asked.quick:
        asked.inputs, asked.states, asked.tests = [3], [16], 6
    found = []
    for inputs in asked.inputs if asked.robot == "bar" else [None]:
        with tempfile.TemporaryDirectory() as scratch:
            sets = (
                both(ROOT / "data/finger-shapes/samples")
                if inputs is None
                else bar(inputs, max(asked.states), asked.tests, Path(scratch))
            )
        for states in asked.states:
            training = sets[0].take(np.arange(min(states, len(sets[0]))))
            found += [measure(kind, training, sets[1]) for kind in asked.kinds]
    print(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
