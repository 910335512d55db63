"""The robot as the block of bytes that the page's WebAssembly reads; web/cfem_page.c has its layout."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.export.firmware.constants import OBSERVERS, Surrogate
from cfem.export.firmware.series import Group, trees_of
from cfem.predict.protocol import Predictor

# What web/cfem_data.h has room for.
ROOM = {
    "CFEM_NA": (8, "actuators"),
    "CFEM_NE": (12, "effector coordinates"),
    "CFEM_NZ": (12, "inputs"),
    "CFEM_DEGREE": (40, "degrees"),
    "CFEM_MODULES": (4, "modules"),
    "skin": (40, "modes of its skin"),
}
DEGREES = ROOM["CFEM_NZ"][0] - 1  # of a group, in memory
HEAD = 18  # numbers of four bytes
OWN = ("potential", "effector")  # series of the model
VECTORS = ("ridge", "least_ridge", "damping", "lambda_low", "lambda_high", "delta_low", "delta_high")
RATES = ("tolerance", "step_limit", "delta_rate", "lambda_rate", "home")


@dataclass(frozen=True)
class SkinSeries:
    """The rows of a skin as series on coordinates of their own: to_box (n_z, n_a), offset (n_z,); coefficients (M, k)
    and degrees (M,) in the last coordinate of the terms, and their groups."""

    to_box: np.ndarray
    offset: np.ndarray
    coefficients: np.ndarray
    degrees: np.ndarray
    groups: list[Group]
    degree: int


def skin_series(predictor: Predictor, skin: dict[str, np.ndarray], p: np.ndarray) -> SkinSeries:
    """Of the arrays of `cfem.predict.skin`, at parameters p (n_p,)."""
    n_a, indices, series = predictor.rows.n_a, skin["indices"].astype(np.int64), skin["series"]
    kept = np.flatnonzero((series != 0).any(axis=0))
    axes, trees = trees_of(indices, {"skin": kept})
    tree = trees["skin"]
    q = predictor.q(p if len(p) else None)
    to_box, offset = skin["to_box"][:, :n_a], skin["offset"] + skin["to_box"][:, n_a:] @ q
    if predictor.form == "force" and len(p):
        to_box = to_box * float(predictor.softer(p))
    return SkinSeries(
        to_box[axes],
        offset[axes],
        series[:, tree.order].T,
        indices[tree.order, axes[-1]],
        tree.groups,
        max(int(indices[kept].max(initial=1)), 1),
    )


def block(model: Surrogate, defines: dict, constants: dict[str, np.ndarray], skin: SkinSeries) -> bytes:
    """model: in double precision; defines and constants: of the controller. InputError where the page has no room."""
    n_skin = skin.coefficients.shape[1]
    sizes = {"CFEM_MODULES": 1, **defines, **model.defines, "skin": n_skin}
    of_skin = {"CFEM_NZ": len(skin.offset), "CFEM_DEGREE": skin.degree}
    for name, (most, what) in ROOM.items():
        asked = max(sizes[name], of_skin.get(name, 0))
        if asked > most:
            raise InputError(f"the page has room for {most} {what}, and this robot has {asked}", do="export C")
    counts = [
        ("spectral", "mlp", "serial").index("serial" if sizes["CFEM_SERIAL"] else "spectral"),
        *(
            sizes[f"CFEM_{name}"]
            for name in ("FORM_DISPLACEMENT", "NA", "NE", "SERIES_NA", "SERIES_NE", "NZ", "DEGREE")
        ),
        sizes["CFEM_MODULES"],
        OBSERVERS.index(sizes["CFEM_OBSERVER"].removeprefix("CFEM_OBSERVER_").lower()),
        *(sizes[f"CFEM_{name}"] for name in ("OBSERVER_ITERATIONS", "COMMAND_FORCE", "ITERATIONS", "HALVINGS")),
        n_skin,
        len(skin.offset),
        skin.degree,
    ]
    scalars = [sizes["CFEM_OBSERVER_TOLERANCE"]]
    arrays = {**constants, **model.arrays}
    numbers = [
        scalars,
        *(arrays[f"cfem_{name}"] for name in ("rest_e", "effector_weight", "far", *VECTORS, *RATES)),
        *arrays["cfem_domain_delta_a"],
        *arrays["cfem_domain_lambda_a"],
        *arrays["cfem_to_box"],
        arrays["cfem_offset"],
        arrays.get("cfem_softer", [1.0]),
        arrays.get("cfem_module_rest", np.zeros(3)),
        *skin.to_box,
        skin.offset,
    ]
    parts = [np.array(counts + [0] * (HEAD - len(counts)), "<i4").tobytes()]
    parts += [np.asarray(one, float).astype("<f8").tobytes() for one in numbers]
    series = [(arrays[f"cfem_{name}"], arrays[f"cfem_{name}_degrees"], model.groups[name]) for name in OWN]
    for coefficients, degrees, groups in (*series, (skin.coefficients, skin.degrees, skin.groups)):
        parts += [
            np.array([len(degrees), len(groups)], "<i4").tobytes(),
            np.asarray(coefficients).astype("<f8").tobytes(),
            degrees.astype(np.uint8).tobytes(),
            b"".join(map(_group, groups)),
        ]
    return b"".join(one + bytes(-len(one) % 8) for one in parts)


def _group(one: Group) -> bytes:
    if one.end > 0xFFFF:
        raise InputError(f"the page has no room for {one.end} terms of a series", do="train it to a lower degree")
    degrees = bytes([one.depth, *one.degrees, *[0] * (DEGREES - len(one.degrees))])
    return np.array(one.end, "<u2").tobytes() + degrees
