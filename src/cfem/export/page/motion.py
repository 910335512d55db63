"""A page's robot in motion: the block that its WebAssembly reads (web/cfem_motion_data.h), and a curve to follow."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.core.errors import NumericalError
from cfem.export.curve import curve_of
from cfem.export.firmware.motion import motion_constants
from cfem.export.firmware.mpc import mpc_constants
from cfem.export.page.layout import joined, motion_layout
from cfem.export.spec import CSpec, FirmwareMpcSpec
from cfem.motion.model import MotionModel
from cfem.motion.modes import natural_modes
from cfem.predict.protocol import Predictor

TICKS_A_PERIOD = 10


@dataclass(frozen=True)
class Moves:
    """A page's robot in motion.

    block: of bytes
    curve: (POINTS, n_e) mm absolute, closed
    facts: what the page's program is told"""

    block: bytes
    curve: np.ndarray
    facts: dict[str, Any]


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
    mpc = spec.mpc or FirmwareMpcSpec(**default, effort=1e-6 if many else 1e-10)
    chosen = spec.model_copy(update={"mpc": mpc.model_copy(update={"obstacles": []}), "scalar": "double"})
    sizes, numbers, constants = mpc_constants(chosen, meta, predictor.arrays, moving)
    counts, arrays, series = motion_constants(meta, moving)
    lists, losses = motion_layout(), counts["LOSSES"]
    integers = _named("CFEM_MOTION_", counts) | _named("CFEM_MPC_", sizes)
    scalars = _named("cfem_mpc_", {name: [numbers[name.upper()]] for name in ("dt", "warp", "length")})
    vectors = scalars | _named("cfem_motion_", arrays) | _named("cfem_mpc_", constants | {"start": start})
    vectors |= {"cfem_motion_kappa": [float(moving["stiffness"])]}
    for name, size in (("prony_terms", losses), ("relaxation", losses), ("prony", counts["TERMS"])):
        vectors[f"cfem_motion_{name}"] = arrays[name][:size]  # C has no empty arrays
    parts = lists.parts(integers, vectors)
    parts += [arrays["first_degrees"], arrays["second_degrees"][:-1]]
    kept = [*series["root"], *series["inner"], *series["loss"][:losses], *series["curve"][: counts["CURVED"]]]
    for packed in kept:
        parts.append(np.array([len(packed.first), len(packed.second)], "<i4"))
        parts += [np.asarray(each, "<u2") for each in (packed.first, packed.end, packed.second)]
        parts.append(packed.coefficients.astype("<f8"))
    # half of the first frequency at most: the eight swings twice a lap
    facts = {"dt": numbers["DT"], "ticks": sizes["TICKS"], "most": float(f"{first / 2:.2g}")}
    return Moves(joined(parts), curve, facts)


def _named(prefix: str, values: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{prefix}{name}": value for name, value in values.items()}
