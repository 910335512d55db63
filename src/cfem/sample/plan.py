"""Plans: rows u of the unit cube, and the actuation that each stands for."""

import numpy as np

from cfem.core.errors import SpecError
from cfem.equilibrium.actuation import Actuation, displacement, force, pull
from cfem.sample.spec import SplitSpec


def unit_rows(split: SplitSpec, columns: int) -> np.ndarray:
    """(rows, columns) in [0, 1]; columns: one an actuator, then one a parameter."""
    if split.method == "random":
        return np.array([_random_row(split.seed, i, columns) for i in range(split.rows)])
    if split.method == "grid":
        return _grid(split.rows, columns)
    from scipy.stats import qmc

    sequence = qmc.Halton if split.method == "scrambled-halton" else qmc.LatinHypercube
    return sequence(columns, rng=split.seed).random(split.rows)


def _random_row(seed: int, i: int, columns: int) -> np.ndarray:
    """Counter-based (Philox keyed by seed and i): no row depends on another."""
    return np.random.Generator(np.random.Philox(key=np.array([seed, i], dtype=np.uint64))).random(columns)


def _grid(rows: int, columns: int) -> np.ndarray:
    side = round(rows ** (1 / columns))
    if side**columns != rows or side < 2:
        what = f"a grid over {columns} actuators and parameters has k^{columns} rows, not {rows}"
        raise SpecError(what, do=f"use e.g. rows: {max(side, 2) ** columns}")
    ticks = np.linspace(0.0, 1.0, side)
    return np.stack(np.meshgrid(*[ticks] * columns, indexing="ij"), axis=-1).reshape(rows, columns)


def actuation(
    space: str, u: np.ndarray, reach: np.ndarray, compliance: np.ndarray, forces: np.ndarray | None = None
) -> Actuation:
    """What row u (n_a,) prescribes: a pull in proportion u within reach (n_a, 2) mm, or u of the box of the reach, or
    of that of the forces (n_a, 2) N, or nothing at rest. compliance: (n_a, n_a) mm/N, W_aa at rest."""
    if space == "rest":
        return force(np.zeros(len(u)))
    if space == "force":
        return force(forces[:, 0] + u * (forces[:, 1] - forces[:, 0]))
    low, high = reach.T
    if space == "displacement":
        return displacement(low + u * (high - low))
    return pull(u, high, within_reach(u, high, compliance)) if u.any() else pull(u, high)


def within_reach(share: np.ndarray, reach: np.ndarray, compliance: np.ndarray) -> float:
    """The amount of a pull (`cfem.equilibrium.actuation.pull`) at which the cable that comes nearest to its reach has
    gone the largest share of it, were the robot as compliant as at rest. Cables on opposite sides pay out what others
    take in, so that their mean says little about any."""
    C = share / (share.sum() * reach)
    moved = compliance @ C
    return float(share.max() * (C @ moved) / (moved / reach).max())
