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
    """Change of a block by a weight at the first watched point.

    largest: N, along -z
    positions: (k,) of numbers of eight bytes in the block
    changes: (3, k), number = its value without weight + sum of changes times powers 1, 2, 3 of the largest's share"""

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
        alike([coefficients[rows] for coefficients in series])
    alike([arrays["series"] for arrays in skins])
    blocks = [
        block_of(type(predictor)(robot.meta, {**robot.arrays, "series": coefficients}), arrays)
        for robot, coefficients, arrays in zip(robots, series, skins, strict=True)
    ]
    words = np.stack([np.frombuffer(block, "<f8") for block in blocks])
    positions = np.flatnonzero((np.frombuffer(blocks[0], "<i8") != words.view("<i8")).any(axis=0))
    changes = np.linalg.solve(np.vander(SHARES[1:], 4)[:, 2::-1], words[1:, positions] - words[0, positions])
    return blocks[0], Weight(largest, positions, changes)


def trusted(predictor: SpectralPredictor, down: np.ndarray) -> float:
    """N: how large a force the model is asked to know, two digits, rounded down. Its estimated error grows with the
    force's second power, or third where the model has third derivatives."""
    power = 3 if THIRD in predictor.arrays else 2
    error = wrench_error(predictor, down)
    force = 0.9 * (TRUSTED * predictor.length / error) ** (1 / power) if error > 0 else np.inf
    if not np.isfinite(force):
        return np.inf
    digit = 10.0 ** (np.floor(np.log10(force)) - 1)
    return float(np.floor(force / digit) * digit)


def alike(series: list[np.ndarray]) -> None:
    """Terms (outputs, M) that any of them has are kept in all."""
    used = np.any([(coefficients != 0).any(axis=0) for coefficients in series], axis=0)
    for coefficients in series:
        coefficients[0, used & (coefficients == 0).all(axis=0)] = KEPT
