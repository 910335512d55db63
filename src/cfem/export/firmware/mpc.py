"""Predictive control in C: sources that are the same for every robot, and its numbers, cfem_mpc_data.c."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.files import write_whole
from cfem.core.errors import InputError, SpecError
from cfem.export.curve import curve_of
from cfem.export.firmware import c_text
from cfem.export.firmware.constants import controller
from cfem.export.firmware.copying import copy_sources
from cfem.export.spec import CSpec
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes, prewarp
from cfem.motion.mpc_spec import EVERY, blocks
from cfem.predict.load import build

NOISE = 0.1  # mm, of a sensor of which nothing is said


def write_c_mpc(
    folder: Path,
    spec: CSpec,
    meta: dict[str, Any],
    arrays: dict[str, np.ndarray],
    moving: dict[str, np.ndarray],
    pressures: np.ndarray | None = None,
) -> None:
    """Adds to a folder that holds the controller and the step in time. moving: of the model's motion.npz; pressures
    (n_a, 2) MPa: as of `write_c`."""
    if spec.scalar != "double":
        what = "predictive control is in double or in single precision throughout"
        raise SpecError(what, where="c.scalar", do="take `arithmetic: float` in its place")
    sizes, numbers, constants = mpc_constants(spec, meta, arrays, moving, pressures)
    copy_sources(folder, "mpc")
    names = {f"CFEM_MPC_{name}": value for name, value in sizes.items()}
    names |= {f"CFEM_MPC_{name}": repr(float(value)) for name, value in numbers.items()}
    heading = c_text.comment(f"Predictive control of {meta['scene']}: by cfem. Units: mm, N, s.")
    c_text.write_constants(folder / "cfem_mpc_data", heading, names, "cfem_mpc_", constants)
    write_whole(folder / "cfem_mpc_vectors.h", _curve(spec, meta, arrays, moving).encode())


def mpc_constants(
    spec: CSpec,
    meta: dict[str, Any],
    arrays: dict[str, np.ndarray],
    moving: dict[str, np.ndarray],
    pressures: np.ndarray | None = None,
) -> tuple[dict[str, int], dict[str, float], dict[str, np.ndarray]]:
    """Sizes, numbers and arrays by name. InputError where the model cannot move."""
    mpc, predictor = spec.mpc, build(meta, arrays)
    model = MotionModel(predictor, moving, meta["motion"]["viscosity"])
    n_e, force, dt = model.rows.n_e, spec.controller.command == "force", 1 / mpc.ticks
    _, limits = controller(predictor, np.zeros(0), spec.controller, spec.scalar, pressures)
    known, home = predictor.domain, limits["cfem_home"]
    bound = {
        name: np.stack([limits[f"cfem_{name}_low"], limits[f"cfem_{name}_high"]], 1) for name in ("lambda", "delta")
    }
    command, course = (bound["lambda"], bound["delta"]) if force else (bound["delta"], bound["lambda"])
    size = np.abs(known.lambda_a if force else predictor.reach.T).max(axis=0)
    course_size = np.abs(predictor.reach.T if force else known.lambda_a).max(axis=0)
    held = not force
    warp = prewarp(float(natural_modes(model, home, held, 1).frequency[0]), dt)
    begins = np.arange(mpc.horizon) if mpc.moves is None else blocks(mpc.horizon, mpc.moves)
    normals, levels = _planes(spec, n_e, predictor.rest_e)
    sizes = {
        "TICKS": mpc.horizon,
        "MOVES": len(begins),
        "EVERY": EVERY,
        "PLANES": len(mpc.obstacles),
        "FORCE": int(force),
        "SENSED": int(mpc.sensor),
        "LATE": mpc.late,
        "GATE_SAMPLES": mpc.gate.samples,
    }
    doubt = mpc.doubt
    numbers = {
        "DT": dt,
        "WARP": warp,
        "LENGTH": predictor.length,
        "DOUBT_NOISE": NOISE if doubt.noise is None else doubt.noise,
        "DOUBT_STIFFNESS": doubt.stiffness,
        "DOUBT_VISCOSITY": doubt.viscosity,
        "DOUBT_WANDER": doubt.wander,
        "DOUBT_OFFSET": doubt.offset,
        "DOUBT_PUSH": doubt.push,
        "GATE_SIGMAS": mpc.gate.sigmas,
    }
    constants = {
        "begins": begins.astype(np.int32),
        "weight": limits["cfem_effector_weight"],
        "smooth": np.sqrt(mpc.smooth) * predictor.length / size,
        "effort": np.sqrt(mpc.effort) * predictor.length / size,
        "size": size,
        "command": command,
        "rate": limits["cfem_lambda_rate" if force else "cfem_delta_rate"],
        "course": course,
        "course_size": course_size,
        "normal": normals,
        "level": levels,
    }
    return sizes, numbers, constants


def _curve(spec: CSpec, meta: dict, arrays: dict[str, np.ndarray], moving: dict[str, np.ndarray]) -> str:
    """cfem_mpc_vectors.h: what the example follows, at a quarter of the first natural frequency."""
    model = MotionModel(build(meta, arrays), moving, meta["motion"]["viscosity"])
    start, curve = curve_of(model)
    first = float(natural_modes(model, start, spec.controller.command == "displacement", 1).frequency[0])
    words = {"CFEM_MPC_CURVE": len(curve), "CFEM_MPC_LAPS": f"{first / 4:.2g}"}
    parts = [
        c_text.array(f"cfem_mpc_{name}", values, "double")[1] for name, values in (("start", start), ("curve", curve))
    ]
    return (
        "/* What mpc_loop.c follows: by cfem export. */\n"
        + c_text.defines(words)
        + "".join(f"static {part}\n" for part in parts)
    )


def _planes(spec: CSpec, n_e: int, rest_e: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Normals (m, n_e) and levels (m,) mm from rest; one of zeros where there is none."""
    planes = spec.mpc.obstacles
    if planes and n_e < 3:
        raise InputError("a plane needs an effector with rows x, y, z", where="c.mpc.obstacles")
    normals, levels = np.zeros((max(len(planes), 1), n_e)), np.zeros(max(len(planes), 1))
    for k, plane in enumerate(planes):
        normal = np.asarray(plane.normal, float) / np.linalg.norm(plane.normal)
        normals[k, :3], levels[k] = normal, float(normal @ (np.asarray(plane.point, float) - rest_e[:3]))
    return normals, levels
