"""Plans: rows u of the unit cube, and the actuation that each stands for."""

import numpy as np

from cfem.core.errors import SpecError
from cfem.equilibrium.actuation import Actuation, displacement, pull
from cfem.sample.spec import SplitSpec


def unit_rows(split: SplitSpec, n_a: int) -> np.ndarray:
    """(rows, n_a) in [0, 1]."""
    if split.method == "random":
        return np.array([_random_row(split.seed, i, n_a) for i in range(split.rows)])
    if split.method == "grid":
        return _grid(split.rows, n_a)
    from scipy.stats import qmc

    sequence = qmc.Halton if split.method == "scrambled-halton" else qmc.LatinHypercube
    return sequence(n_a, rng=split.seed).random(split.rows)


def _random_row(seed: int, i: int, n_a: int) -> np.ndarray:
    """Counter-based (Philox keyed by seed and i): no row depends on another."""
    return np.random.Generator(np.random.Philox(key=np.array([seed, i], dtype=np.uint64))).random(n_a)


def _grid(rows: int, n_a: int) -> np.ndarray:
    side = round(rows ** (1 / n_a))
    if side**n_a != rows or side < 2:
        near = max(side, 2)
        raise SpecError(f"a grid over {n_a} actuators has k^{n_a} rows, not {rows}", do=f"use e.g. rows: {near**n_a}")
    ticks = np.linspace(0.0, 1.0, side)
    return np.stack(np.meshgrid(*[ticks] * n_a, indexing="ij"), axis=-1).reshape(rows, n_a)


def actuation(space: str, u: np.ndarray, reach: np.ndarray) -> Actuation:
    """What row u (n_a,) prescribes within reach (n_a, 2) mm: a pull in proportion u, or u of the box."""
    low, high = reach.T
    return pull(u, high) if space == "pulling" else displacement(low + u * (high - low))
