"""A page's robot in motion: the block that its WebAssembly reads (web/cfem_motion_data.h), and a curve to follow."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.export.curve import curve_of
from cfem.export.firmware.motion import motion_constants
from cfem.export.firmware.mpc import mpc_constants
from cfem.export.spec import CSpec, FirmwareMpcSpec
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes
from cfem.predict.protocol import Predictor

ROOM = {
    "NQ": (20, "motions"),
    "LOSSES": (4, "viscous materials"),
    "TERMS": (4, "Prony terms"),
    "DEGREE": (40, "degrees"),
}
ROOM |= {"PRODUCTS": (256, "products in a half of its mass"), "TICKS": (20, "ticks in the horizon")}
COUNTS = ("NQ", "LOSSES", "TERMS", "DEGREE", "CURVED", "FIRST_PRODUCTS", "SECOND_PRODUCTS")
TICKS_A_PERIOD = 10


@dataclass(frozen=True)
class Moves:
    """block: of bytes; curve (POINTS, n_e) mm absolute, closed; said: what the page's program is told."""

    block: bytes
    curve: np.ndarray
    said: dict[str, Any]


def moves(meta: dict, predictor: Predictor, moving: dict[str, np.ndarray], spec: CSpec) -> Moves | None:
    """None where the model has no curve to follow. InputError where the page has no room for the motion."""
    model = MotionModel(predictor, moving, meta["motion"]["viscosity"])
    try:
        start, curve = curve_of(model)
        first = float(natural_modes(model, start, spec.controller.command == "displacement", 1).frequency[0])
    except NumericalError:
        return None
    many = model.n_a > 3  # more actuators than coordinates of a point
    default = {"ticks": f"{TICKS_A_PERIOD * first:.3g} Hz", "moves": 8 if many else None}
    own = spec.mpc or FirmwareMpcSpec(**default, effort=1e-6 if many else 1e-10)
    chosen = spec.model_copy(update={"mpc": own.model_copy(update={"obstacles": []}), "scalar": "double"})
    sizes, numbers, constants = mpc_constants(chosen, meta, predictor.arrays, moving)
    counts, arrays, series = motion_constants(meta, moving)
    of = counts | {"TICKS": sizes["TICKS"]}
    for name, (most, what) in ROOM.items():
        if of[name] > most:
            raise InputError(f"the page has room for {most} {what}, and this robot has {of[name]}", do="export C")
    whole = [*(of[name] for name in COUNTS), *(sizes[name] for name in ("TICKS", "MOVES", "EVERY", "FORCE"))]
    parts = [np.array(one, "<i4") for one in (whole, constants["begins"], arrays["prony_terms"][: of["LOSSES"]])]
    scalars = [numbers["DT"], numbers["WARP"], numbers["LENGTH"], float(moving["stiffness"])]
    vectors = [scalars, arrays["relaxation"][: of["LOSSES"]], *arrays["prony"][: of["TERMS"]], arrays["scale"]]
    vectors += [*arrays["to_box"], arrays["offset"], start]
    vectors += [constants[name] for name in ("weight", "smooth", "effort", "size", "rate", "course_size")]
    vectors += [*constants["command"], *constants["course"]]
    parts += [np.asarray(one, "<f8") for one in vectors]
    parts += [arrays["first_degrees"], arrays["second_degrees"][:-1]]
    kept = [*series["root"], *series["inner"], *series["loss"][: of["LOSSES"]], *series["curve"][: of["CURVED"]]]
    for one in kept:
        parts.append(np.array([len(one.first), len(one.second)], "<i4"))
        parts += [np.asarray(each, "<u2") for each in (one.first, one.end, one.second)]
        parts.append(one.coefficients.astype("<f8"))
    block = b"".join(one.tobytes() + bytes(-one.nbytes % 8) for one in parts)
    # half of the first frequency at most: the eight swings twice a lap
    said = {"dt": numbers["DT"], "ticks": sizes["TICKS"], "most": float(f"{first / 2:.2g}")}
    return Moves(block, curve, said)
