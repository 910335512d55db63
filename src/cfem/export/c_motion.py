"""The step in time in C: cfem_motion.c, the same for every robot, and its numbers, cfem_motion_data.c."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.core.files import disk_errors, write_whole
from cfem.export import c_text
from cfem.motion.model import layout
from cfem.predict.energy import layout as static_layout

SOURCES = Path(__file__).parent / "motion"
DATA = ("cfem_motion_data.c", "cfem_motion_data.h")


def write_c_motion(folder: Path, meta: dict[str, Any], arrays: dict[str, np.ndarray], moving: dict[str, Any]) -> int:
    """Fills `folder`; the bytes of the constants. meta, arrays: of a spectral model; moving: of its motion.npz.
    InputError where the model is of another kind."""
    if meta["kind"] != "spectral" or meta["form"] != "displacement":
        raise InputError("only spectral models of form displacement move in C", do="train kind: spectral")
    with disk_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for path in SOURCES.iterdir():
            shutil.copyfile(path, folder / path.name)
    sizes, constants = motion_constants(meta, arrays, moving)
    header = [
        c_text.comment(f"{meta['scene']} in motion: by cfem. Units: mm, N, s, t."),
        "\n#ifndef CFEM_MOTION_DATA_H\n#define CFEM_MOTION_DATA_H\n\n#include <stdint.h>\n\n",
        c_text.defines(sizes),
        "\n",
    ]
    body = ['#include "cfem_motion_data.h"\n\n']
    kinds = {"f8": "double", "u1": "uint8_t", "i4": "int"}
    for name, values in constants.items():
        declaration, definition = c_text.array(f"cfem_motion_{name}", values, kinds[values.dtype.str[1:]])
        header.append(declaration + "\n")
        body.append(definition + "\n\n")
    header.append(f"#define cfem_motion_stiffness {float(moving['stiffness'])!r}\n\n#endif\n")
    write_whole(folder / DATA[1], "".join(header).encode())
    write_whole(folder / DATA[0], "".join(body).encode())
    return sum(values.nbytes for values in constants.values())


def motion_constants(
    meta: dict[str, Any], arrays: dict[str, np.ndarray], moving: dict[str, Any]
) -> tuple[dict[str, int], dict[str, np.ndarray]]:
    """Sizes, and arrays by name. Terms whose coefficients are all 0 are left out."""
    n_a, n_e = arrays["to_box"].shape[0], len(meta["rows"]["effectors"])
    n_q = len(moving["scale"])
    viscosity = meta["motion"]["viscosity"]
    parts, where = static_layout(n_a, n_e), layout(n_q, n_q - n_a, n_e, len(viscosity))
    static = np.concatenate([arrays["series"][parts[name]] for name in ("gradient", "hessian", "effector")])
    motion, loss = moving["series"][: where["H"].stop], moving["series"][where["H"].stop :]
    prony = np.array([pair for one in viscosity for pair in one["prony"]], dtype=float).reshape(-1, 2)
    counts = np.array([len(one["prony"]) for one in viscosity], dtype=np.int32)
    constants = {"static_to_box": arrays["to_box"], "static_offset": arrays["offset"], "scale": moving["scale"]}
    constants |= {"moving_to_box": moving["to_box"], "moving_offset": moving["offset"]}
    constants["relaxation"] = np.array([one["relaxation"] for one in viscosity] or [0.0], dtype=float)
    constants["prony_terms"] = counts if len(counts) else np.zeros(1, dtype=np.int32)
    constants["prony"] = prony if len(prony) else np.ones((1, 2))
    sizes = {"NA": n_a, "NQ": n_q, "NE": n_e, "LOSSES": len(viscosity), "TERMS": len(prony)}
    sizes["CURVED"] = int("curve" in moving)
    degree, none = 0, np.zeros((1, len(moving["indices"])))
    for name, series, indices in (
        ("static", static, arrays["indices"]),
        ("moving", motion, moving["indices"]),
        ("loss", loss if len(loss) else none, moving["indices"]),
        ("curve", moving.get("curve", none), moving["indices"]),
    ):
        kept = np.flatnonzero((series != 0).any(axis=0)) if (series != 0).any() else np.zeros(1, dtype=int)
        constants[name] = np.ascontiguousarray(series[:, kept].T, dtype=float)
        constants[f"{name}_degrees"] = indices[kept].astype(np.uint8)
        sizes[f"{name.upper()}_TERMS"] = len(kept)
        degree = max(degree, int(indices[kept].max(initial=0)))
    sizes["DEGREE"] = max(degree, 1)
    return {f"CFEM_MOTION_{name}": value for name, value in sizes.items()}, constants
