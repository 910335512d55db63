"""`cfem export`: a trained model to a folder that control runs from, each format compared with the trained model."""

import shutil
import warnings
from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.core.files import file_sha256, write_json, write_whole
from cfem.core.spec import load_spec
from cfem.core.stage import Options, Stage, artefact_file, run_stage
from cfem.export.spec import ExportSpec
from cfem.predict.load import build, read_arrays, read_meta
from cfem.robot.spec import SceneSpec

FILES = {"arrays": "weights.npz", "onnx": "model.onnx", "torchscript": "model.ts", "c": "c"}


def run(spec_path: Path, overrides: Iterable[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The export's manifest; results: largest relative difference from the trained model and size, by format."""
    spec = load_spec(spec_path, ExportSpec, overrides)
    model = spec_path.parent / spec.model
    pressures = None
    if spec.scene is not None:
        pressures = stated_pressures(spec_path.parent / spec.scene, read_meta(model)["rows"]["actuators"])
    extra = {"pressures": pressures.tolist()} if pressures is not None else {}
    stage = Stage(
        name="export",
        version=2,
        spec=spec,
        inputs={"model": model},
        out=out or spec_path.parent / spec.out,
        paths=("model", "scene", "out"),
        extra=extra | ({"c": _sources()} if "c" in spec.formats else {}),
    )
    return run_stage(stage, partial(work, spec=spec, model_folder=model, pressures=pressures), options)


def stated_pressures(scene: Path, names: list[str]) -> np.ndarray:
    """(n_a, 2) MPa, the smallest and largest of each actuator. InputError where one states none, or where they are not
    those of the model (names)."""
    actuators = load_spec(scene, SceneSpec).actuators
    if [item.name for item in actuators] != names:
        raise InputError(
            f"its actuators are {', '.join(item.name for item in actuators)}, the model's {', '.join(names)}",
            where=str(scene),
        )
    stated = [getattr(item, "pressure", None) for item in actuators]
    if any(each is None for each in stated):
        raise InputError("not every actuator states its pressures", where=str(scene), do="leave out `scene`")
    return np.array(stated)


def _sources() -> dict[str, str]:
    """Content hashes of the C code that an export copies."""
    from cfem.export.c_export import SOURCES

    return {path.name: file_sha256(path) for path in sorted(SOURCES.iterdir())}


def work(folder: Path, spec: ExportSpec, model_folder: Path, pressures: np.ndarray | None = None) -> dict[str, Any]:
    """Writes every format, runs each from its file, compares. pressures: (n_a, 2) MPa, bounds of the multipliers."""
    meta, arrays = read_meta(model_folder), read_arrays(model_folder)
    if "arrays" in spec.formats:
        shutil.copyfile(artefact_file(model_folder, "weights.npz"), folder / FILES["arrays"])
    if {"onnx", "torchscript"} & set(spec.formats):
        write_graphs(folder, spec, meta, arrays)
    vectors = read_arrays(model_folder, "test_vectors.npz")
    reference = vectors["W"], vectors["delta_free"]
    parity = {
        name: max(map(difference, reference, RUNNERS[name](folder / FILES[name], meta, vectors["s"], vectors["p"])))
        for name in spec.formats
        if name != "c"
    }
    sizes = {name: (folder / FILES[name]).stat().st_size for name in parity}
    embedded = None
    if "c" in spec.formats:
        embedded = write_embedded(folder / FILES["c"], spec, meta, arrays, vectors, pressures)
        sizes["c"] = embedded["coefficient_bytes"]
        if embedded["parity"] is not None:
            parity["c"] = embedded["parity"]
    write_json(folder / "model.json", {**meta, "parity": parity})
    headline = [
        f"{name}: {sizes[name]} bytes, off by {error:.1e} from the trained model" for name, error in parity.items()
    ]
    if embedded and embedded["parity"] is None:
        headline.append("c: not compared with the trained model, there is no C compiler here")
    results = {"headline": headline, "kind": meta["kind"], "parity": parity, "bytes": sizes, "errors": meta["errors"]}
    return {**results, "c": embedded} if embedded else results


def write_embedded(
    folder: Path,
    spec: ExportSpec,
    meta: dict,
    arrays: dict[str, np.ndarray],
    vectors: dict,
    pressures: np.ndarray | None,
) -> dict:
    """What its report.json says, and parity: of the blocks that control uses, in the compiled code, with the trained
    model at the scene's own parameters; None without a compiler, or with parameters of its own."""
    from cfem.export.c_export import write_c
    from cfem.export.compiled import CompiledController, compiler, sizes

    report = write_c(folder, meta, arrays, spec.c, vectors["s"], pressures)
    report["bytes"] = sizes(folder)
    write_json(folder / "report.json", report)
    if not compiler() or spec.c.parameters:
        return {**report, "parity": None}
    model, controller = build(meta, arrays), CompiledController(folder)
    e, a = model.rows.e, model.rows.a
    expected = [model.at(s) for s in vectors["s"]]
    W, free, delta = (np.array([getattr(one, name) for one in expected]) for name in ("W", "delta_free", "delta"))
    here = [controller.model(s) for s in vectors["s"]]
    # delta_free is a part of delta, whose size it takes: of a robot as linear as a rod it is rounding alone.
    blocks = {
        "W_aa": (W[:, a, a], W[:, a, a]),
        "W_ea": (W[:, e, a], W[:, e, a]),
        "free_a": (free[:, a], delta[:, a]),
        "free_e": (free[:, e], delta[:, e]),
    }
    off = [
        np.abs(np.reshape([one[name] for one in here], block.shape) - block).max() / np.abs(size).max()
        for name, (block, size) in blocks.items()
    ]
    return {**report, "parity": float(max(off))}


def write_graphs(folder: Path, spec: ExportSpec, meta: dict, arrays: dict[str, np.ndarray]) -> None:
    from cfem.export.onnx import example, onnx_bytes
    from cfem.export.torchscript import torchscript_bytes
    from cfem.surrogate.torch_model import module_of

    model = module_of(meta, arrays)
    if "onnx" in spec.formats:
        write_whole(folder / FILES["onnx"], onnx_bytes(model, meta))
    if "torchscript" in spec.formats:
        write_whole(folder / FILES["torchscript"], torchscript_bytes(model, example(meta)))


def difference(reference: np.ndarray, found: np.ndarray) -> float:
    """Largest difference, relative to the largest entry."""
    return float(np.abs(found - reference).max() / np.abs(reference).max())


def _run_arrays(path: Path, meta: dict, s: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    with np.load(path, allow_pickle=False) as arrays:
        return build(meta, dict(arrays)).evaluate(s, p)


def _run_onnx(path: Path, meta: dict, s: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    from cfem.predict.onnx import OnnxPredictor

    return OnnxPredictor(meta, path).evaluate(s, p)


def _run_torchscript(path: Path, meta: dict, s: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, ...]:
    import torch

    inputs = (s, p) if meta["parameters"] else (s,)
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore", DeprecationWarning)
        return tuple(out.numpy() for out in torch.jit.load(path)(*map(torch.as_tensor, inputs)))


RUNNERS = {"arrays": _run_arrays, "onnx": _run_onnx, "torchscript": _run_torchscript}
