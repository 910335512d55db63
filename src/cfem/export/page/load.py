"""A weight at the tip of a page's robot. The loaded robot is one of the same series, whose coefficients are polynomials
of the weight (`cfem.predict.loads.loaded`): the page makes its block of any weight from four that are computed here."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.loads.loaded import TRUSTED, loaded, wrench_error
from cfem.predict.loads.loaded_skin import loaded_skin
from cfem.predict.protocol import Predictor
from cfem.predict.series.energy import THIRD, layout

SHARES = np.arange(4) / 3  # of the largest weight; its energy is of third degree
KEPT = 1e-300  # stands for a coefficient that is 0 at one weight and not at another, so that all blocks are alike
Arrays = dict[str, np.ndarray]


@dataclass(frozen=True)
class Weight:
    """largest: N, along -z at the first watched point; positions (k,) of numbers of eight bytes in the block; changes
    (3, k): number = its value without weight + sum of changes times powers 1, 2, 3 of the share of the largest."""

    largest: float
    positions: np.ndarray
    changes: np.ndarray


def weight(
    predictor: Predictor, skin: Arrays, row: int, block_of: Callable[[Predictor, Arrays], bytes]
) -> tuple[bytes, Weight] | None:
    """The block without weight, and what any weight makes of it; row: of the watched point's x; block_of: the block of
    a predictor and its skin. None where the model does not know what a weight does."""
    known = isinstance(predictor, SpectralPredictor) and "compliance" in skin
    if not known or predictor.parameters or predictor.meta.get("wrench"):
        return None
    down = np.zeros(predictor.rows.n_e)
    down[row + 2] = -1.0
    largest = trusted(predictor, down)
    if not np.isfinite(largest):
        return None
    robots = [predictor if not share else loaded(predictor, share * largest * down) for share in SHARES]
    skins = [loaded_skin(predictor, skin, share * largest * down) for share in SHARES]
    parts = layout(predictor.rows.n_a, predictor.rows.n_e)
    series = [robot.arrays["series"].copy() for robot in robots]
    for rows in (parts["energy"], parts["effector"]):
        alike([one[rows] for one in series])
    alike([one["series"] for one in skins])
    filled = [type(predictor)(one.meta, {**one.arrays, "series": own}) for one, own in zip(robots, series, strict=True)]
    blocks = [block_of(*one) for one in zip(filled, skins, strict=True)]
    words = np.stack([np.frombuffer(one, "<f8") for one in blocks])
    positions = np.flatnonzero((np.frombuffer(blocks[0], "<i8") != words.view("<i8")).any(axis=0))
    found = np.linalg.solve(np.vander(SHARES[1:], 4)[:, 2::-1], words[1:, positions] - words[0, positions])
    return blocks[0], Weight(largest, positions, found)


def trusted(predictor: SpectralPredictor, down: np.ndarray) -> float:
    """N: how large a force the model is asked to know, two digits, rounded down. Its estimated error grows with the
    force's second power, or third where the model has third derivatives."""
    power = 3 if THIRD in predictor.arrays else 2
    error = wrench_error(predictor, down)
    found = 0.9 * (TRUSTED * predictor.length / error) ** (1 / power) if error > 0 else np.inf
    if not np.isfinite(found):
        return np.inf
    digit = 10.0 ** (np.floor(np.log10(found)) - 1)
    return float(np.floor(found / digit) * digit)


def alike(series: list[np.ndarray]) -> None:
    """Terms (outputs, M) that any of them has are kept in all."""
    used = np.any([(one != 0).any(axis=0) for one in series], axis=0)
    for one in series:
        one[0, used & (one == 0).all(axis=0)] = KEPT
