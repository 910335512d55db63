"""Modules in a row under loads, or of different models, as constants of the C controller: c/cfem_row.c."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np

from cfem.condensed.packing import pack_upper, packed_indices, unpacking
from cfem.constraint.patch import PatchLoad
from cfem.export.firmware import c_text
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.loads.loaded_rows import rows_of
from cfem.predict.rows.patches import RowPatches
from cfem.predict.rows.serial import SerialPredictor
from cfem.predict.series.chebyshev import union
from cfem.predict.series.energy import FOURTH, FOURTH_INDICES

PARTS = ("potential", "effector", "compliance", "change", "curvature")
TYPES = """
/* Terms of a series, by their number in the basis, and for each its coefficients. */
typedef struct {
    int terms;
    const uint16_t *term;
    const cfem_real *coefficients;
} cfem_terms;

/* A model of modules: the degrees of its basis in each coordinate z = to_box s + offset, and its series. */
typedef struct {
    int n_a, terms, degree;
    const double *to_box, *offset;
    const uint8_t *degrees;
    cfem_terms potential, effector, compliance, change, curvature;
} cfem_module;

extern const cfem_module cfem_modules[CFEM_MODELS];
"""


@dataclass(frozen=True)
class Tables:
    """One model of modules. to_box (n, n), offset (n,), degrees (M, n); series: by name the numbers (m,) of its terms
    and their coefficients (m, outputs)."""

    to_box: np.ndarray
    offset: np.ndarray
    degrees: np.ndarray
    series: dict[str, tuple[np.ndarray, np.ndarray]]

    @property
    def nbytes(self) -> int:
        return self.degrees.nbytes + sum(values.nbytes for pair in self.series.values() for values in pair)


def more_than_series(row: SerialPredictor) -> bool:
    """Tells whether a row is more than the series of one module and where the next one begins (c/cfem_serial.c)."""
    return row.meta.get("wrench") is not None or len(row.models) > 1 or row.heavy


def tables_of(row: SerialPredictor, scalar: str) -> tuple[list[Tables], list[int]]:
    """Tables of each model, and which of these the modules are. A module under forces on patches has its own."""
    patches = borne(row)
    loaded = any(row.meta.get("wrench") or []) or patches.places > 0
    kinds = [
        (number, i if loads else -1) for i, (number, loads) in enumerate(zip(row.which, patches.each, strict=True))
    ]
    distinct = sorted(set(kinds))
    models = [(row.models[number], () if i < 0 else patches.each[i]) for number, i in distinct]
    every = [tables(model, row.pose, loaded, scalar, loads, patches.places) for model, loads in models]
    return every, [distinct.index(kind) for kind in kinds]


def borne(row: SerialPredictor) -> RowPatches:
    return row.patches or RowPatches.none(len(row.which))


def tables(
    model: SpectralPredictor,
    watched: int,
    loaded: bool,
    scalar: str,
    patches: Sequence[PatchLoad] = (),
    places: int = 0,
) -> Tables:
    """Tables of a module of a row.

    watched: number of its effector rows that are its pose
    loaded: whether wrenches act on the rows
    patches: bear forces; their rows are behind those of the pose
    places: of patches; up to so many, rows that do not move fill up"""
    rows, arrays = rows_of(model, patches), model.arrays
    kept = np.r_[:watched, model.rows.n_e : rows.e.shape[1]]
    still, indices = (0, watched + 3 * places - len(kept)), rows.indices.astype(np.int64)
    C = np.pad(rows.C[:, kept][:, :, kept], ((0, 0), still, still))
    parts = {"potential": rows.psi, "effector": np.pad(rows.e[:, kept], ((0, 0), still))}
    none = np.zeros((len(indices), 1))
    parts["compliance"] = pack_upper(C) if loaded else none
    third = loaded and rows.D is not None
    parts["change"] = rows.D[:, *packed_indices(watched, 3)] if third else none
    fourth = third and FOURTH in arrays
    known = arrays[FOURTH_INDICES].astype(np.int64) if fourth else indices[:0]
    indices, (of_own, of_fourth) = union(indices, known)
    for name, coefficients in parts.items():
        parts[name] = np.zeros((coefficients.shape[1], len(indices)))
        parts[name][:, of_own] = coefficients.T
    parts["curvature"] = np.zeros((comb(watched + 3, 4) if fourth else 1, len(indices)))
    if fourth:
        parts["curvature"][:, of_fourth] = arrays[FOURTH][unpacking(model.rows.n_e, 4)[*packed_indices(watched, 4)]]
    used = np.flatnonzero(np.any([(coefficients != 0).any(axis=0) for coefficients in parts.values()], axis=0))
    number = np.zeros(len(indices), np.uint16)
    number[used] = np.arange(len(used))
    kept = {name: np.flatnonzero((coefficients != 0).any(axis=0)) for name, coefficients in parts.items()}
    real = np.dtype("float32" if scalar == "float" else "float64")
    return Tables(
        arrays["to_box"],
        arrays["offset"],
        indices[used].astype(np.uint8),
        {name: (number[terms], parts[name][:, terms].T.astype(real)) for name, terms in kept.items()},
    )


def constants(
    row: SerialPredictor, models: list[Tables], which: list[int]
) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """Defines and arrays of the row."""
    patches = borne(row)
    defines = {
        "CFEM_SPECTRAL": 0,
        "CFEM_MLP": 0,
        "CFEM_SERIAL": 0,
        "CFEM_ROW": 1,
        "CFEM_MODULES": len(row.which),
        "CFEM_MODELS": len(models),
        "CFEM_POSE": row.pose,
        "CFEM_ROW_PATCHES": patches.places,
        "CFEM_MODULE_NA": max(len(model.offset) for model in models),
        "CFEM_MODULE_DEGREE": max(int(model.degrees.max(initial=1)) for model in models),
        "CFEM_MODULE_LENGTH": repr(row.length / len(row.which)),
    }
    arrays = {
        "cfem_module_model": np.array(which, np.uint8),
        "cfem_module_rest": np.hstack([row.rests, patches.rests]),
        "cfem_row_force": patches.forces if patches.places else np.zeros((len(which), 3)),  # C has no empty arrays
        "cfem_module_share": row.shares,
        "cfem_softer": row.softer,
        "cfem_wrench": np.asarray(row.meta.get("wrench") or np.zeros(row.rows.n_e), float),
    }
    return defines, arrays


def text(models: list[Tables]) -> tuple[str, str]:
    """Text for cfem_data.h, and for cfem_data.c."""
    body, rows = [], []

    def add(name: str, values: np.ndarray, kind: str) -> str:
        body.append("static " + c_text.array(name, values, kind)[1] + "\n\n")
        return name

    for number, model in enumerate(models):
        places = [
            add(f"module_{number}_{name}", getattr(model, name).ravel(), "double") for name in ("to_box", "offset")
        ]
        places.append(add(f"module_{number}_degrees", model.degrees.ravel(), "uint8_t"))
        series = []
        for name in PARTS:
            terms, coefficients = model.series[name]
            if not len(terms):
                series.append("{0, 0, 0}")
                continue
            which = add(f"module_{number}_{name}_terms", terms, "uint16_t")
            values = add(f"module_{number}_{name}", coefficients.ravel(), "cfem_real")
            series.append(f"{{{len(terms)}, {which}, {values}}}")
        sizes = [len(model.offset), len(model.degrees), int(model.degrees.max(initial=1))]
        rows.append("{" + ", ".join([*map(str, sizes), *places, *series]) + "}")
    body.append("const cfem_module cfem_modules[CFEM_MODELS] = {" + ",\n".join(rows) + "};\n")
    return TYPES, "".join(body)
