"""Modules in a row under loads, or of different models, as constants of the C controller: c/cfem_row.c."""

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from cfem.export import c_text
from cfem.predict.chebyshev import union
from cfem.predict.energy import FOURTH, FOURTH_INDICES, THIRD, layout, unpacking, unpacking3, unpacking4
from cfem.predict.serial import SerialPredictor
from cfem.predict.spectral import SpectralPredictor

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
        return self.degrees.nbytes + sum(one.nbytes for pair in self.series.values() for one in pair)


def more_than_series(row: SerialPredictor) -> bool:
    """Whether a row is more than the series of one module and where the next one begins (c/cfem_serial.c)."""
    return row.meta.get("wrench") is not None or len(row.models) > 1 or row.heavy


def tables(model: SpectralPredictor, watched: int, loaded: bool, scalar: str) -> Tables:
    """watched: of its effector rows, so many are the pose; loaded: whether wrenches act on them."""
    n_e, arrays = model.rows.n_e, model.arrays
    parts, series = layout(model.rows.n_a, n_e), arrays["series"]
    i, j = np.triu_indices(watched)
    found = {"potential": series[parts["energy"]], "effector": series[parts["effector"]][:watched]}
    own, none = arrays["indices"].astype(np.int64), np.zeros((1, series.shape[1]))
    found["compliance"] = series[parts["effector_compliance"]][unpacking(n_e)[i, j]] if loaded else none
    third = loaded and THIRD in arrays
    found["change"] = arrays[THIRD][_entries(unpacking3(n_e), watched)] if third else none
    fourth = third and FOURTH in arrays
    indices, (of_own, of_fourth) = union(own, arrays[FOURTH_INDICES].astype(np.int64) if fourth else own[:0])
    for name, one in found.items():
        found[name] = np.zeros((len(one), len(indices)))
        found[name][:, of_own] = one
    found["curvature"] = np.zeros((comb(watched + 3, 4) if fourth else 1, len(indices)))
    if fourth:
        found["curvature"][:, of_fourth] = arrays[FOURTH][_entries(unpacking4(n_e), watched)]
    used = np.flatnonzero(np.any([(one != 0).any(axis=0) for one in found.values()], axis=0))
    number = np.zeros(len(indices), np.uint16)
    number[used] = np.arange(len(used))
    kept = {name: np.flatnonzero((one != 0).any(axis=0)) for name, one in found.items()}
    real = np.dtype("float32" if scalar == "float" else "float64")
    return Tables(
        arrays["to_box"],
        arrays["offset"],
        indices[used].astype(np.uint8),
        {name: (number[terms], found[name][:, terms].T.astype(real)) for name, terms in kept.items()},
    )


def _entries(place: np.ndarray, watched: int) -> np.ndarray:
    """Where the entries i <= j <= ... of a symmetric tensor of the watched rows are among those of all."""
    return np.array([place[one] for one in combinations_with_replacement(range(watched), place.ndim)])


def constants(row: SerialPredictor, models: list[Tables]) -> tuple[dict[str, float], dict[str, np.ndarray]]:
    """Defines and arrays of the row."""
    pose = row.rests.shape[1]
    defines = {
        "CFEM_SPECTRAL": 0,
        "CFEM_MLP": 0,
        "CFEM_SERIAL": 0,
        "CFEM_ROW": 1,
        "CFEM_MODULES": len(row.which),
        "CFEM_MODELS": len(models),
        "CFEM_POSE": pose,
        "CFEM_MODULE_NA": max(len(one.offset) for one in models),
        "CFEM_MODULE_DEGREE": max(int(one.degrees.max(initial=1)) for one in models),
        "CFEM_MODULE_LENGTH": repr(row.length / len(row.which)),
    }
    arrays = {
        "cfem_module_model": np.array(row.which, np.uint8),
        "cfem_module_rest": row.rests,
        "cfem_module_share": row.shares,
        "cfem_softer": row.softer,
        "cfem_wrench": np.asarray(row.meta.get("wrench") or np.zeros(row.rows.n_e), float),
    }
    return defines, arrays


def text(models: list[Tables]) -> tuple[str, str]:
    """For cfem_data.h, and for cfem_data.c."""
    body, rows = [], []

    def add(name: str, values: np.ndarray, kind: str) -> str:
        body.append("static " + c_text.array(name, values, kind)[1] + "\n\n")
        return name

    for number, one in enumerate(models):
        places = [add(f"module_{number}_{name}", getattr(one, name).ravel(), "double") for name in ("to_box", "offset")]
        places.append(add(f"module_{number}_degrees", one.degrees.ravel(), "uint8_t"))
        series = []
        for name in PARTS:
            terms, coefficients = one.series[name]
            if not len(terms):
                series.append("{0, 0, 0}")
                continue
            which = add(f"module_{number}_{name}_terms", terms, "uint16_t")
            values = add(f"module_{number}_{name}", coefficients.ravel(), "cfem_real")
            series.append(f"{{{len(terms)}, {which}, {values}}}")
        sizes = [len(one.offset), len(one.degrees), int(one.degrees.max(initial=1))]
        rows.append("{" + ", ".join([*map(str, sizes), *places, *series]) + "}")
    body.append("const cfem_module cfem_modules[CFEM_MODELS] = {" + ",\n".join(rows) + "};\n")
    return TYPES, "".join(body)
