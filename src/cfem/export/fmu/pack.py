"""FMUs of a robot from its C folder: zip files of descriptions, sources and, where there is a compiler, a binary."""

import hashlib
import io
import platform
import re
import shutil
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.condensed.condensed import Condensed
from cfem.core.artefact.files import disk_errors, write_whole
from cfem.core.console.shown import size
from cfem.core.errors import InputError
from cfem.export.compiled.build import FAST, STANDARD, compiler, objects, run
from cfem.export.firmware import c_text
from cfem.export.firmware.constants import controller, surrogate
from cfem.export.firmware.copying import copy_sources, library_files, target_files
from cfem.export.fmu.description import Fmu, build_description, model_description
from cfem.export.fmu.variables import controller_blocks, estimator_blocks, robot_blocks, state_blocks
from cfem.export.spec import ExportSpec, FmuPart
from cfem.motion.load import FILE as MOTION
from cfem.motion.load import load_motion
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes
from cfem.predict.load import has_file
from cfem.predict.protocol import Predictor

STEPS = 40  # of the first natural period of a robot that moves: a midpoint rule is then 0.2 % late
ADAPTERS = {"controller": "controller", "robot": "robot", "moving": "robot", "estimator": "estimator"}
WHAT = {
    "controller": "inverse controller on the condensed model",
    "robot": "robot at rest at each instant",
    "moving": "robot in motion",
    "estimator": "estimator of shape and forces from markers",
}
SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
WHEN = (1980, 1, 1, 0, 0, 0)  # of each file, so that the same FMU has the same bytes


def parts_of(spec: ExportSpec, moves: bool) -> tuple[FmuPart, ...]:
    """Those that the spec names, or else all that the model and the spec give. InputError where one cannot be."""
    able = {"controller": True, "robot": True, "moving": moves, "estimator": spec.c.estimate is not None}
    missing = {
        "moving": "the model has not learned to move, or is under loads or at other parameters",
        "estimator": "`c.estimate` says nothing of markers",
    }
    for name in spec.fmu.parts or ():
        if not able[name]:
            raise InputError(missing[name], where=f"fmu.parts: {name}", do="leave it out")
    return spec.fmu.parts or tuple(name for name, can in able.items() if can)


def motion_of(spec: ExportSpec, model_folder: Path) -> MotionModel | None:
    """Motion of the robot that the spec exports, None where it has none."""
    moves = has_file(model_folder, MOTION) and not spec.loads and not spec.c.parameters
    return load_motion(model_folder) if moves else None


def write_fmus(
    folder: Path,
    code: Path,
    spec: ExportSpec,
    meta: dict,
    arrays: dict[str, np.ndarray],
    motion: MotionModel | None,
) -> tuple[list[str], int]:
    """Writes NAME.fmu of each part; what to say of them, and their bytes. code: the C folder of the same spec; meta,
    arrays: of the model, its effectors at rest where the robot has them; motion: None of a robot that has none."""
    model, p = surrogate(meta, arrays, spec.c)
    home = controller(model.reference, p, spec.c.controller, spec.c.scalar)[1]["cfem_home"]
    start = model.reference.at(home, p if len(p) else None)
    sizes = {}
    with disk_errors(folder):
        folder.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, ignore_cleanup_errors=True) as place:
        shared = _compiled(code, library_files(code), Path(place)) if compiler() else None
        for part in parts_of(spec, motion is not None):
            fmu = _fmu(part, spec, model.reference, start, motion)
            data = _packed(fmu, part, code, Path(place) / part, shared)
            write_whole(folder / f"{part}.fmu", data)
            sizes[part] = len(data)
    names = ", ".join(f"{name}.fmu {size(bytes_)}" for name, bytes_ in sizes.items())
    binaries = "sources only, as there is no C compiler here" if shared is None else f"binaries for {target()[0]}"
    return [f"fmu: {names}; {binaries}"], sum(sizes.values())


def _fmu(part: FmuPart, spec: ExportSpec, model: Predictor, start: Condensed, motion: MotionModel | None) -> Fmu:
    """start: the robot where the controller begins."""
    scene, settings = model.meta["scene"], spec.c.controller
    described = re.sub(r"\W", "_", f"{scene}_{part}"), f"{scene}: {WHAT[part]}"
    if part == "estimator":
        moves = spec.c.estimate.dynamics is not None
        return Fmu(*described, estimator_blocks(model, spec.c), 1 / spec.c.estimate.rate, None, moves)
    command = start.lambda_a if settings.command == "force" else start.delta_a
    if part == "controller":
        return Fmu(*described, controller_blocks(model, spec.c), 1 / spec.fmu.ticks, None, False)
    longest = None
    if part == "moving":
        held = settings.command == "displacement"
        first = float(natural_modes(motion, start.delta_a, held, 1).frequency[0])
        longest = spec.fmu.step or 1 / (STEPS * first)
    blocks = robot_blocks(model, spec.c, command)
    if part == "moving" and settings.command == "force":  # displacements would have to be differentiated
        blocks |= state_blocks(motion)
    return Fmu(*described, blocks, None, longest, part == "moving")


def _packed(fmu: Fmu, part: FmuPart, code: Path, place: Path, shared: Sequence[Path] | None) -> bytes:
    """The file. place: a folder to be made; shared: objects of the C folder, None where there is no compiler."""
    adapter = ("cfem_fmu.c", "cfem_fmu_absent.c", f"cfem_fmu_{ADAPTERS[part]}.c")
    copy_sources(place, *(f"fmu/{name}" for name in ("cfem_fmi3.h", "cfem_fmu.h", *adapter)))
    with disk_errors(place):
        for name in target_files(code):
            shutil.copyfile(code / name, place / name)
    token = _token(model_description(fmu, ""), *(path.read_bytes() for path in sorted(place.iterdir())))
    for name, text in zip(("cfem_fmu_data.h", "cfem_fmu_data.c"), _data(fmu, token), strict=True):
        write_whole(place / name, text.encode())
    files = {"modelDescription.xml": model_description(fmu, token)}
    files["sources/buildDescription.xml"] = build_description(fmu.identifier, library_files(place))
    files |= {f"sources/{path.name}": path.read_bytes() for path in sorted(place.iterdir())}
    if shared is not None:
        system, end = target()
        library = f"{fmu.identifier}{end}"
        parts = (*shared, *_compiled(place, (*adapter, "cfem_fmu_data.c"), place))
        run([compiler(), *FAST, "-shared", "-o", library, *(str(path.resolve()) for path in parts), "-lm"], place)
        files[f"binaries/{system}/{library}"] = (place / library).read_bytes()
    return _zip(files)


def _data(fmu: Fmu, token: str) -> tuple[str, str]:
    """cfem_fmu_data.h, cfem_fmu_data.c."""
    words = {"CFEM_FMU_TOKEN": c_text.string(token), "CFEM_FMU_MOVES": int(fmu.moves)}
    words |= {} if fmu.tick is None else {"CFEM_FMU_TICK": repr(fmu.tick)}
    words |= {} if fmu.longest is None else {"CFEM_FMU_LONGEST": repr(fmu.longest)}
    rows = ['{"time", "s", 0, 0, 0, 0.0}']
    for block, variables in fmu.blocks.items():
        words[f"CFEM_FMU_{block}"] = len(rows)
        for variable in variables:
            texts = c_text.string(variable.name), c_text.string(variable.unit)
            flags = int(variable.counts), int(variable.input), int(variable.missing)
            start = "NAN" if variable.missing else c_text.number(variable.start, "double")
            rows.append("{" + ", ".join(map(str, (*texts, *flags, start))) + "}")
    words["CFEM_FMU_VARIABLES"], words["CFEM_FMU_STATES"] = len(rows), len(fmu.blocks.get("STATE", ()))
    heading = c_text.comment(f"{fmu.description}, as a unit of co-simulation: by cfem export.")
    header = f"{heading}\n#ifndef CFEM_FMU_DATA_H\n#define CFEM_FMU_DATA_H\n\n{c_text.defines(words)}\n#endif\n"
    table = ",\n".join(rows)
    body = f"const cfem_fmu_variable cfem_fmu_variables[CFEM_FMU_VARIABLES] = {{\n{table}}};\n"
    return header, f'#include "cfem_fmu.h"\n\n#include <math.h>\n\n{body}'


def target() -> tuple[str, str]:
    """Name of this platform as FMI has it, and how its libraries end."""
    machine = platform.machine().lower()
    system, end = SYSTEMS.get(sys.platform, (sys.platform, ".so"))
    return f"{MACHINES.get(machine, machine)}-{system}", end


def _compiled(folder: Path, names: Sequence[str], place: Path) -> list[Path]:
    """Objects. Names stay within the library, so that two FMUs in a process keep apart."""
    return objects([compiler(), *STANDARD, *FAST, "-fPIC", "-fvisibility=hidden"], folder, names, place)


def _token(*contents: bytes) -> str:
    """Instantiation token, the same for the same contents."""
    digest = hashlib.sha256(b"".join(contents)).hexdigest()
    return "{" + "-".join((digest[:8], digest[8:12], digest[12:16], digest[16:20], digest[20:32])) + "}"


def _zip(files: dict[str, bytes]) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in files.items():
            info = zipfile.ZipInfo(name, WHEN)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o755 << 16
            packed.writestr(info, data)
    return out.getvalue()
