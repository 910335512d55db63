"""The robot at rest as the block of bytes that the page's WebAssembly reads."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.export.firmware.constants import OBSERVERS, Surrogate
from cfem.export.firmware.series import Group, trees_of
from cfem.export.page.layout import joined, robot_layout
from cfem.predict.protocol import Predictor

KINDS = ("spectral", "mlp", "serial")  # in the order of cfem_room.h


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
    """Series of the arrays of `cfem.predict.series.skin`, at parameters p (n_p,)."""
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
    """The block of a robot at rest. model: in double precision; defines and constants: of the controller. InputError
    where the page has no room."""
    lists = robot_layout()
    sizes = {"CFEM_MODULES": 1, **defines, **model.defines, "CFEM_SKIN_ROWS": skin.coefficients.shape[1]}
    sizes |= {"CFEM_KIND": KINDS.index("serial" if sizes["CFEM_SERIAL"] else "spectral")}
    sizes |= {"CFEM_OBSERVER": OBSERVERS.index(sizes["CFEM_OBSERVER"].removeprefix("CFEM_OBSERVER_").lower())}
    sizes |= {"CFEM_SKIN_NZ": len(skin.offset), "CFEM_SKIN_DEGREE": skin.degree}
    arrays = {"cfem_softer": [1.0], "cfem_module_rest": np.zeros(3), **constants, **model.arrays}
    arrays |= {"cfem_observer_tolerance": [sizes["CFEM_OBSERVER_TOLERANCE"]]}
    arrays |= {"cfem_skin_to_box": skin.to_box, "cfem_skin_offset": skin.offset}
    arrays |= {"cfem_skin": skin.coefficients, "cfem_skin_degrees": skin.degrees}
    groups = {f"cfem_{name}": series_groups for name, series_groups in model.groups.items()} | {
        "cfem_skin": skin.groups
    }
    parts: list[np.ndarray | bytes] = lists.parts(sizes, arrays)
    for name in lists.trees:
        degrees = np.asarray(arrays[f"{name}_degrees"], np.uint8)
        parts += [np.array([len(degrees), len(groups[name])], "<i4"), np.asarray(arrays[name], "<f8"), degrees]
        parts.append(b"".join(_group(group, lists.room["CFEM_MOST_NZ"] - 1) for group in groups[name]))
    return joined(parts)


def _group(group: Group, degrees: int) -> bytes:
    """A group as C has it, with memory for so many degrees. InputError where its end is beyond 16 bits."""
    if group.end > 0xFFFF:
        raise InputError(f"the page has no room for {group.end} terms of a series", do="train it to a lower degree")
    return np.array(group.end, "<u2").tobytes() + bytes(
        [group.depth, *group.degrees, *[0] * (degrees - len(group.degrees))]
    )
