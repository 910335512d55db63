"""What a model of any kind learns of the skin: Chebyshev series of its rows and of their compliance, by least squares.

They are observed as effectors are (`cfem.surrogate.series.observations`): value and gradient of every row and the
compliance that is left with the actuators locked, with one derivative more of each where the samples have it."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.model import Form
from cfem.condensed.packing import packed_indices
from cfem.condensed.skin import Skin
from cfem.predict.series.skin import LearnedSkin
from cfem.surrogate.series.coordinates import box_coordinates
from cfem.surrogate.series.observations import Observations, in_box, inputs, mean_hessian, observations
from cfem.surrogate.series.spectral import fit_quantity

MAX_DEGREE, MAX_TERMS, FOLDS = 16, 1000, 5
COMPLIANCE_NUMBERS = 200_000  # largest number of coefficients of all compliances


@dataclass(frozen=True)
class SkinFront:
    """Error of the surface in test states with the first 0, 1, ... modes of a model. rms, largest: mm, the second a
    bound: what the modes leave and the error of the model, each at its largest, are added."""

    rms: list[float]
    largest: list[float]


def fit_skin(dataset: Any, skin: Skin, form: Form, core: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of `cfem.predict.series.skin.LearnedSkin`. dataset: training rows (cfem.dataset.reader.Dataset) that
    have the skin; core: arrays of the model, whose box coordinates serve again if it has them."""
    s, q = inputs(dataset, form)
    known = observations(joined(dataset), form)
    n_e, k = dataset.rows.n_e, len(skin.modes)
    if "to_box" in core:
        to_box, offset = core["to_box"], core["offset"]
    else:
        to_box, offset = box_coordinates(s, q, mean_hessian(known["potential"]))
    z = np.hstack([s, q]) @ to_box.T + offset
    rows = _part(known["effector"], np.arange(n_e, n_e + k))
    C = _part(known["effector_compliance"], of_skin(n_e, k))
    series, _, _ = fit_quantity(z, in_box(rows, to_box), MAX_DEGREE, MAX_TERMS, FOLDS)
    most = max(1 + z.shape[1], COMPLIANCE_NUMBERS // C.values.shape[2])
    compliance, _, _ = fit_quantity(z, in_box(C, to_box), MAX_DEGREE, min(most, MAX_TERMS), FOLDS)
    inside = {
        "inner_nodes": skin.inner_nodes.astype(np.int32),
        "inner_rest": skin.inner_rest,
        "inner_modes": skin.inner_modes.astype(np.float32),
    }
    return (inside if len(skin.inner_nodes) else {}) | {
        "nodes": skin.nodes.astype(np.int32),
        "rest": skin.rest,
        "triangles": skin.triangles.astype(np.int32),
        "weights": skin.weights.astype(np.float32),
        "modes": skin.modes.astype(np.float32),
        "to_box": to_box,
        "offset": offset,
        "indices": series.indices.astype(np.uint8),
        "series": series.coefficients.T.copy(),
        "compliance_indices": compliance.indices.astype(np.uint8),
        "compliance": compliance.coefficients.T.copy(),
    }


def joined(dataset: Any) -> Any:
    """The dataset with the rows of the skin as effectors behind its own."""
    with_skin, rows = dataset.with_skin, dataset.rows
    by_p = with_skin.ddelta_s_dp
    return replace(
        dataset,
        rows=Rows((*rows.effectors, *with_skin.rows.skin), rows.actuators),
        W=with_skin.W,
        dW=with_skin.dW,
        dC=None,
        d2C=None,
        delta_e=np.hstack([dataset.delta_e, with_skin.delta_s]),
        ddelta_e_dp=None if by_p is None else np.concatenate([dataset.ddelta_e_dp, by_p], axis=1),
        with_skin=None,
    )


def of_skin(n_e: int, k: int) -> np.ndarray:
    """Places in the packed upper triangle (n_e + k rows) of C_es, row by row, then of the upper triangle of C_ss."""
    first, second = packed_indices(n_e + k)
    across, within = (first < n_e) & (second >= n_e), first >= n_e
    return np.concatenate([np.flatnonzero(across), np.flatnonzero(within)])


def _part(observed: Observations, components: np.ndarray) -> Observations:
    return replace(observed, values=observed.values[:, :, components])


def judge(skin: LearnedSkin, with_skin: Any, s: np.ndarray, q: np.ndarray) -> SkinFront:
    """Errors of a skin at the states of a test set, inputs s (m, n_a) and q (m, n_q); with_skin: their WithSkin. As the
    modes are orthonormal in the surface's weights, what they leave is at right angles to the error of the model in
    them: the root mean square is exact but for rounding."""
    predicted, true = skin.rows(s, q), with_skin.delta_s
    wrong = np.tensordot(-true, skin.modes, axes=(1, 0))  # (m, nodes, 3) by which the model's surface is off in modes
    farthest = np.linalg.norm(skin.modes, axis=2).max(axis=1)
    rounding = np.finfo(np.float32).eps / 2 * np.abs(true) @ farthest  # of the stored modes
    rms, largest = [], []
    for count in range(len(skin) + 1):
        if count:
            wrong += np.tensordot(predicted[:, count - 1 : count], skin.modes[count - 1 : count], axes=(1, 0))
        square = (wrong**2).sum(axis=2)
        rms.append(float(np.sqrt(np.mean(square @ skin.weights + with_skin.left[:, 0] ** 2))))
        largest.append(float((np.sqrt(square.max(axis=1)) + with_skin.left[:, 1] + rounding).max()))
    return SkinFront(rms, largest)
