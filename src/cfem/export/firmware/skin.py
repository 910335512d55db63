"""The whole surface in C, beside the controller: cfem_shape.c, the same for every robot, and its modes, cfem_skin.c."""

from pathlib import Path

import numpy as np

from cfem.condensed.parameters import vector
from cfem.export.firmware import c_text
from cfem.export.firmware.copying import copy_sources
from cfem.export.spec import CSpec
from cfem.predict.protocol import Predictor
from cfem.predict.rows.serial import SerialPredictor


def write_c_skin(folder: Path, model: Predictor, arrays: dict[str, np.ndarray], spec: CSpec) -> int:
    """Adds the skin (arrays of `cfem.predict.series.skin`) of a model to its C folder; the bytes of its constants."""
    return _write(folder, skin_constants(model, arrays, spec), len(arrays["rest"]), "shape")


def write_c_row_skin(folder: Path, row: SerialPredictor, spec: CSpec) -> int:
    """Adds the skin of modules in a row, all of one model; the bytes of its constants. Each node names its module and
    its number there."""
    surface = row.surface
    constants = skin_constants(row.models[0], surface.modules[0].arrays, spec)
    constants["triangles"] = _numbers(surface.triangles, len(surface.rest))
    constants["owner"] = surface.owner.astype(np.uint8)
    constants["own"] = _numbers(surface.number, len(surface.modules[0].rest))
    return _write(folder, constants, len(surface.rest), "shape", "row_shape")


def _write(folder: Path, constants: dict[str, np.ndarray], nodes: int, *parts: str) -> int:
    """Adds a surface of `nodes` nodes and the parts of the sources that shape it; the bytes of its constants."""
    copy_sources(folder, "controller/cfem_chebyshev.h", *parts)
    degrees, modes = constants["degrees"], constants["modes"]
    sizes = {
        "CFEM_SKIN_NODES": nodes,
        "CFEM_SKIN_TRIANGLES": len(constants["triangles"]),
        "CFEM_SKIN_ROWS": len(modes),
        "CFEM_SKIN_TERMS": len(degrees),
        "CFEM_SKIN_NZ": degrees.shape[1],
        "CFEM_SKIN_DEGREE": int(degrees.max(initial=0)),
    }
    heading, data = "/* The surface of the robot: by cfem export. */", '#include "cfem_data.h"\n'
    return c_text.write_constants(folder / "cfem_skin", heading, sizes, "cfem_skin_", constants, data)


def skin_constants(model: Predictor, arrays: dict[str, np.ndarray], spec: CSpec) -> dict[str, np.ndarray]:
    """Arrays of the skin of one robot, whose parameters are folded in: to_box (nz, n_a), offset (nz,), degrees (M, nz),
    series (M, k), modes (k, 3 m), rest (3 m,), triangles (t, 3)."""
    n_a = model.rows.n_a
    p = vector(model.parameters, spec.parameters, "c.parameters")
    softer = float(model.softer(p)) if len(p) and model.form == "force" else 1.0
    to_box, m = arrays["to_box"], len(arrays["rest"])
    return {
        "to_box": softer * to_box[:, :n_a],
        "offset": arrays["offset"] + to_box[:, n_a:] @ model.q(p),
        "degrees": arrays["indices"].astype(np.uint8),
        "series": np.ascontiguousarray(arrays["series"].T, dtype=float),
        "modes": arrays["modes"].reshape(-1, 3 * m).astype(np.float32),
        "rest": arrays["rest"].ravel().astype(float),
        "triangles": _numbers(arrays["triangles"], m),
    }


def _numbers(values: np.ndarray, below: int) -> np.ndarray:
    return values.astype(np.uint16 if below < 2**16 else np.uint32)
