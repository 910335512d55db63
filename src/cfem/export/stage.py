"""`cfem export`: a trained model to a folder that control runs from, each format compared with the trained model."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import file_sha256, plain, write_json, write_npz, write_whole
from cfem.core.console.progress import doing
from cfem.core.console.shown import size
from cfem.core.errors import InputError
from cfem.core.optional import demand, remedy
from cfem.core.spec import load_spec
from cfem.core.stage import Command
from cfem.export.firmware.embedding import Embedding, embedding, write_embedded
from cfem.export.loads import solves_patches, under_loads
from cfem.export.skin import write_row_skin, write_skin
from cfem.export.spec import PACKAGES, ExportSpec, writable
from cfem.export.written import RUNNERS, largest_difference
from cfem.motion import load as motion
from cfem.predict.load import VECTORS, build, has_file, has_skin, read_arrays, read_meta, read_model, read_vectors
from cfem.predict.loads.loaded_skin import skin_under_loads_of
from cfem.predict.rows import serial_skin
from cfem.predict.series.skin import FILE
from cfem.robot.same_robot import demand_robot
from cfem.robot.spec import SceneSpec, scene_meaning

MOTION = motion.FILE
FILES = {"arrays": "weights.npz", "onnx": "model.onnx", "torchscript": "model.ts"}
FILES |= {"c": "c", "html": "page.html", "fmu": "fmu", "arduino": "arduino", "mjcf": "mjcf"}
IN_C = {"c", "fmu", "arduino"}
CONTROLLERS = {*IN_C, "html"}
IN_PYTHON = {  # not of the model alone
    "c contact": "contact in Python",
    "c estimate": "the estimator in Python",
    "c swing": "the filter in Python",
}
NOTHING = Embedding()


def _with_formats(spec: ExportSpec) -> ExportSpec:
    """Those that can be written here, unless given."""
    return spec if "formats" in spec.model_fields_set else spec.model_copy(update={"formats": writable()})


def _mesh(spec: ExportSpec, base: Path) -> dict[str, Path]:
    """Mesh of the scene, for those exports that solve it."""
    scene = base / spec.scene if _solves(spec) else None
    return {"mesh": scene.parent / load_spec(scene, SceneSpec).out} if scene else {}


def _solves(spec: ExportSpec) -> bool:
    return ("c" in spec.formats and bool(spec.c.obstacles)) or solves_patches(spec)


def _extra(spec: ExportSpec, base: Path) -> Callable[[], dict[str, Any]]:
    """Function that reads what determines the output beside the model: C sources, a scene that is solved, embedding."""

    def extra() -> dict[str, Any]:
        chosen = CONTROLLERS & set(spec.formats)
        contents: dict[str, Any] = {name: _sources(name) for name in sorted(chosen)}
        if _solves(spec):
            contents["scene"] = scene_meaning(base / spec.scene)
        return contents | ({"embedding": plain(vars(_embedding(spec, base)))} if chosen else {})

    return extra


def _work(folder: Path, spec: ExportSpec, base: Path) -> dict[str, Any]:
    """Results: largest relative difference from the trained model and size, by format."""
    skin, scene = (base / path if path else None for path in (spec.skin, spec.scene))
    return work(folder, spec, base / spec.model, _embedding(spec, base), skin, scene)


def _embedding(spec: ExportSpec, base: Path) -> Embedding:
    if not CONTROLLERS & set(spec.formats):
        return NOTHING
    meta, scene = read_meta(base / spec.model), None
    if spec.scene is not None:
        scene = load_spec(base / spec.scene, SceneSpec)
        demand_robot(scene, meta.get("robot"), base / spec.model, "name the scene that the model was trained of")
    return embedding(meta, spec.c, scene)


def _sources(name: str) -> dict[str, str]:
    """Content hashes of what an export copies from the package."""
    if name == "html":
        from cfem.export.page.file import sources

        return sources()
    from cfem.export.firmware.copying import SOURCES

    return {f"{path.parent.name}/{path.name}": file_sha256(path) for path in sorted(SOURCES.glob("*/*"))}


def work(
    folder: Path,
    spec: ExportSpec,
    model_folder: Path,
    embedded: Embedding = NOTHING,
    skin_folder: Path | None = None,
    scene: Path | None = None,
) -> dict[str, Any]:
    """Writes every format, runs each from its file, compares. skin_folder: of the model whose skin a page draws, if it
    is another; scene: that of the spec."""
    for name in spec.formats:
        demand(*PACKAGES.get(name, ()), where=f"formats: {name}")
    meta, arrays = read_model(model_folder)
    vectors = read_vectors(model_folder, meta)
    if spec.loads:
        meta, arrays, vectors = under_loads(spec, meta, arrays, vectors, model_folder, scene)
    write_npz(folder / VECTORS, vectors)
    page_bytes = None
    if "html" in spec.formats:
        from cfem.export.page.file import write_page

        skin = skin_folder or model_folder
        page_bytes = write_page(folder / FILES["html"], spec, meta, arrays, model_folder, skin, embedded)
    if "arrays" in spec.formats:
        write_npz(folder / FILES["arrays"], arrays)
        if has_file(model_folder, MOTION) and not spec.loads:  # loads move the states that it was learned at
            write_npz(folder / MOTION, read_arrays(model_folder, MOTION))
    if {"onnx", "torchscript"} & set(spec.formats):
        doing("importing PyTorch, writing ONNX and TorchScript")
        write_graphs(folder, spec, meta, arrays)
    doing("running what was written, to compare it with the trained model")
    parity = {
        name: largest_difference(name, folder / FILES[name], meta, vectors) for name in spec.formats if name in RUNNERS
    }
    sizes = {name: (folder / FILES[name]).stat().st_size for name in parity}
    report, made = None, []
    if IN_C & set(spec.formats):
        from cfem.export.firmware.copying import lasting_or_not

        with lasting_or_not(folder / FILES["c"], "c" in spec.formats) as code:
            report, c_parity, bytes_ = _write_c(code, spec, model_folder, meta, arrays, vectors["s"], embedded, scene)
            made, made_sizes = _write_made_of_c(folder, code, spec, model_folder, embedded.at_rest(meta), arrays)
        parity |= c_parity
        sizes |= bytes_ | made_sizes
    if "mjcf" in spec.formats:
        sizes["mjcf"] = _write_mjcf(folder / FILES["mjcf"], model_folder)
        made.append(f"mjcf: {FILES['mjcf']}/robot.xml, {size(sizes['mjcf'])}")
    parity |= _write_shape(folder, spec, model_folder, meta, arrays, vectors)
    write_json(folder / "model.json", {**meta, "parity": parity})
    headline = [*_compared(spec, parity, sizes, report), *made]
    if page_bytes is not None:
        sizes["html"] = page_bytes
        headline.append(f"html: {FILES['html']}, {size(page_bytes)}")
    results = {"headline": headline, "kind": meta["kind"], "parity": parity, "bytes": sizes, "errors": meta["errors"]}
    return {**results, "c": report} if report else results


def _compared(
    spec: ExportSpec, parity: dict[str, float], sizes: dict[str, int], report: dict[str, Any] | None
) -> list[str]:
    """Lines about how far each format is from the trained model, and which were left out."""
    held = {name: f"{size(count)}, " for name, count in sizes.items()}
    if "c" in held:
        held["c"] = f"coefficients {held['c']}"
    headline = [
        f"{name}: {held.get(name, '')}largest relative difference from "
        f"{IN_PYTHON.get(name, 'the trained model')} {error:.1e}"
        for name, error in parity.items()
    ]
    if report and report["parity"] is None:
        headline.append("c: not compared with the trained model, there is no C compiler here")
    if spec.formats == writable() and (left := [name for name in PACKAGES if name not in spec.formats]):
        headline.append(f"{' and '.join(left)}: left out, they need PyTorch ({remedy('torch')})")
    return headline


def _write_made_of_c(
    folder: Path,
    code: Path,
    spec: ExportSpec,
    model_folder: Path,
    meta: dict,
    arrays: dict[str, np.ndarray],
) -> tuple[list[str], dict[str, int]]:
    """Formats that are made of the C folder `code`: lines of the headline, and bytes by format. meta: of the model, its
    effectors at rest where the robot has them."""
    lines, sizes = [], {}
    if "arduino" in spec.formats:
        from cfem.export.firmware.arduino import write_library

        library = write_library(folder / FILES["arduino"], code, meta)
        sizes["arduino"] = sum(path.stat().st_size for path in library.rglob("*") if path.is_file())
        lines.append(f"arduino: library {library.name}, {size(sizes['arduino'])}")
    if "fmu" in spec.formats:
        from cfem.export.fmu.pack import motion_of, write_fmus

        place, motion = folder / FILES["fmu"], motion_of(spec, model_folder)
        fmus, sizes["fmu"] = write_fmus(place, code, spec, meta, arrays, motion)
        lines += fmus
    return lines, sizes


def _write_c(
    place: Path,
    spec: ExportSpec,
    model_folder: Path,
    meta: dict,
    arrays: dict[str, np.ndarray],
    states: np.ndarray,
    embedded: Embedding,
    scene: Path | None,
) -> tuple[dict[str, Any], dict[str, float], dict[str, int]]:
    """The controller, and what the spec asks for beside it: motion, predictive control, contact, an estimator. What
    is reported of it; relative differences from the trained model, where there is a compiler; bytes."""
    report = write_embedded(place, spec.c, meta, arrays, states, embedded)
    parity, sizes = {"c": report["parity"]}, {"c": report["coefficient_bytes"]}
    moves = has_file(model_folder, MOTION) and not spec.loads
    if moves:
        from cfem.export.firmware.motion import write_c_motion

        moving = read_arrays(model_folder, MOTION)
        report["motion_bytes"] = write_c_motion(place, meta, arrays, moving)
    if spec.c.mpc is not None:
        from cfem.export.firmware.mpc import write_c_mpc

        if not moves:
            what = "predictive control needs a model that has learned to move, and no loads"
            raise InputError(what, where="c.mpc", do="sample with dynamics: true and train again, or leave `mpc` out")
        write_c_mpc(place, spec.c, meta, arrays, moving, embedded.pressures)
    if spec.c.arithmetic == "float":
        from cfem.export.firmware.single import write_single

        write_single(place)
    if spec.c.obstacles:
        from cfem.export.firmware.touching import write_touch

        report["contact"] = write_touch(place, spec.c, scene, model_folder, states)
        parity["c contact"], sizes["c contact"] = report["contact"]["parity"], report["contact"]["bytes"]
    if spec.c.estimate is not None:
        parity |= _estimator(place, spec, model_folder)
    return report, {name: error for name, error in parity.items() if error is not None}, sizes


def _write_shape(
    folder: Path, spec: ExportSpec, model_folder: Path, meta: dict, arrays: dict, vectors: dict
) -> dict[str, float]:
    """The skin in every format, and its relative differences. InputError where one is asked for that is not there."""
    if has_skin(model_folder):
        skin = read_arrays(model_folder, FILE)
        if spec.loads:
            skin = skin_under_loads_of(build(meta, arrays), skin)
        return write_skin(folder, spec, meta, arrays, skin, vectors)
    if has_file(model_folder, serial_skin.FILE):
        skins = read_arrays(model_folder, serial_skin.FILE)
        return write_row_skin(folder, spec, build(meta, arrays), skins, vectors)
    if spec.shape:
        what = "has no skin, and so no shape"
        raise InputError(what, where=str(spec.model), do="sample it with `skin: {}` in sample.yaml, and train again")
    return {}


def _estimator(folder: Path, spec: ExportSpec, model_folder: Path) -> dict[str, float]:
    """Adds it to the C folder, and with `dynamics` the filter of what moves; their parity, where there is a compiler.
    InputError where the model cannot tell."""
    from cfem.export.compiled.build import compiler
    from cfem.export.compiled.estimate import estimate_parity
    from cfem.export.firmware.estimate import write_c_estimate
    from cfem.predict.load import load_model

    if spec.loads:
        raise InputError("an estimator of a loaded robot has no C code", where="loads", do="leave out c.estimate")
    made, estimate = write_c_estimate(folder, load_model(model_folder), spec.c), spec.c.estimate
    parity = {"c estimate": estimate_parity(folder, made)} if compiler() else {}
    if estimate.dynamics is None:
        return parity
    from cfem.export.compiled.swing import swing_parity
    from cfem.export.firmware.swing import write_c_swing
    from cfem.motion.load import load_motion

    filtered = write_c_swing(folder, made, spec.c, load_motion(model_folder))
    return parity | ({"c swing": swing_parity(folder, filtered, 1 / estimate.rate)} if compiler() else {})


def _write_mjcf(folder: Path, model_folder: Path) -> int:
    """Writes the robot for MuJoCo; bytes. InputError where the model has no skin."""
    from cfem.mujoco.description import robot_mjcf
    from cfem.predict.load import load_model

    text = robot_mjcf(load_model(model_folder)).encode()
    write_whole(folder / "robot.xml", text)
    return len(text)


def write_graphs(folder: Path, spec: ExportSpec, meta: dict, arrays: dict[str, np.ndarray]) -> None:
    """Writes the model as ONNX and TorchScript, as far as the spec asks for them."""
    from cfem.export.onnx import example, onnx_bytes
    from cfem.export.torchscript import torchscript_bytes
    from cfem.surrogate.modules import module_of

    model = module_of(meta, arrays)
    if "onnx" in spec.formats:
        write_whole(folder / FILES["onnx"], onnx_bytes(model, meta))
    if "torchscript" in spec.formats:
        write_whole(folder / FILES["torchscript"], torchscript_bytes(model, example(meta)))


COMMAND = Command(
    "export",
    5,
    ExportSpec,
    _work,
    ("model", "skin"),
    outside=("scene",),
    reads=_mesh,
    extra=_extra,
    complete=_with_formats,
)
run, stage = COMMAND.run, COMMAND.stage
