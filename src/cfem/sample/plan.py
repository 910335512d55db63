"""Plans: rows u of the unit cube, the actuation that each stands for, and the order in which they are solved: a
skeleton spread over the plan, then compact shards through which one walks from row to row.

The order depends on the plan alone, so that what a state is started from never depends on who solves it."""

from collections.abc import Callable

import numpy as np

from cfem.condensed.spread import spread
from cfem.core.errors import SpecError
from cfem.equilibrium.system.actuation import Actuation, displacement, force, pull
from cfem.equilibrium.system.solution import Equilibrium
from cfem.sample.spec import SplitSpec

# A pull of all at once that is not borne is made smaller by this factor, and given up below the other.
_SHORTER, _LEAST = 0.85, 0.05
# Shares of a pull of all at once that are tried as well: beyond the load at which a body buckles there may be another
# branch, which a solve finds or not.
_ON_THE_WAY = (0.25, 0.5, 0.75, 1.0)
# Of the largest pull of all at once that is borne: near the load at which a body buckles its compliance grows without
# bound, which no series follows.
_SAFE = 0.7


def unit_rows(split: SplitSpec, columns: int) -> np.ndarray:
    """Rows (rows, columns) in [0, 1]; columns: one an actuator, then one a parameter."""
    if split.method == "random":
        return np.array([_random_row(split.seed, i, columns) for i in range(split.rows)])
    if split.method == "grid":
        return _grid(split.rows, columns)
    from scipy.stats import qmc

    sequence = qmc.Halton if split.method == "scrambled-halton" else qmc.LatinHypercube
    return sequence(columns, rng=split.seed).random(split.rows)


def _random_row(seed: int, i: int, columns: int) -> np.ndarray:
    """Row i of the plan, counter-based (Philox keyed by seed and i): it depends on no other row."""
    return np.random.Generator(np.random.Philox(key=np.array([seed, i], dtype=np.uint64))).random(columns)


def _grid(rows: int, columns: int) -> np.ndarray:
    side = round(rows ** (1 / columns))
    if side**columns != rows or side < 2:
        what = f"a grid over {columns} actuators and parameters has k^{columns} rows, not {rows}"
        raise SpecError(what, do=f"use e.g. rows: {max(side, 2) ** columns}")
    ticks = np.linspace(0.0, 1.0, side)
    return np.stack(np.meshgrid(*[ticks] * columns, indexing="ij"), axis=-1).reshape(rows, columns)


def with_idle(u: np.ndarray, n_a: int, idle: float) -> np.ndarray:
    """Rows (m, n) whose first n_a columns, of the actuators, are 0 in this share of them and spread over [0, 1] in the
    others."""
    u = u.copy()
    u[:, :n_a] = np.maximum(u[:, :n_a] - idle, 0.0) / (1.0 - idle)
    return u


def actuation(
    space: str,
    u: np.ndarray,
    reach: np.ndarray,
    compliance: np.ndarray,
    forces: np.ndarray | None = None,
    together: float = 1.0,
) -> Actuation:
    """Actuation of row u (n_a,): a pull in proportion u within reach (n_a, 2) mm, or u of the box of the reach, or of
    that of the forces (n_a, 2) N, or nothing at rest. compliance: (n_a, n_a) mm/N, W_aa at rest; together: see
    `borne_together`."""
    if space == "rest":
        return force(np.zeros(len(u)))
    if space == "force":
        return force(forces[:, 0] + u * (forces[:, 1] - forces[:, 0]))
    low, high = reach.T
    if space == "displacement":
        return displacement(low + u * (high - low))
    if not u.any():
        return pull(u, high)
    return pull(u, high, borne(u, high, compliance, together, within_reach(u, high, compliance)))


def within_reach(share: np.ndarray, reach: np.ndarray, compliance: np.ndarray) -> float:
    """The amount of a pull (`pull` of cfem.equilibrium) at which the cable that comes nearest to its reach has
    gone the largest share of it, were the robot as compliant as at rest. Cables on opposite sides pay out what others
    take in, so that their mean says little about any."""
    C = share / (share.sum() * reach)
    moved = compliance @ C
    return float(share.max() * (C @ moved) / (moved / reach).max())


def borne(share: np.ndarray, reach: np.ndarray, compliance: np.ndarray, together: float, amount: float) -> float:
    """The amount of a pull, made smaller where its load is larger than that of all actuators at once at the share
    `together` of their reach, and than that of one alone at its reach. An actuator's load is its force, relative to
    that which takes it alone to its reach; the load of a pull is the sum, as what buckles a body is the sum of the
    forces along it."""
    if together >= 1.0:
        return amount
    everyone = np.ones(len(share))
    most = together * within_reach(everyone, reach, compliance) * _load(everyone, reach, compliance)
    return min(amount, max(1.0, most) / _load(share, reach, compliance))


def _load(share: np.ndarray, reach: np.ndarray, compliance: np.ndarray) -> float:
    """Load of a pull by an amount of 1, were the robot as compliant as at rest."""
    C = share / (share.sum() * reach)
    return float((C * np.diag(compliance) / reach).sum() / (C @ compliance @ C))


def borne_together(solve: Callable[[Actuation], Equilibrium], reach: np.ndarray, compliance: np.ndarray) -> float:
    """The share of their reach (n_a,) to which all actuators are pulled at once: 1 where that and less are stable
    equilibria, else with a margin. Nobody commands actuators against each other until the robot buckles, and states
    near there cost ten times as much as others."""
    together, everyone = 1.0, np.ones(len(reach))
    if len(reach) == 1:
        return together
    amount = within_reach(everyone, reach, compliance)
    while together > _LEAST:
        tried = (solve(pull(everyone, reach, part * together * amount)) for part in _ON_THE_WAY)
        failed = next(
            ((part, ended) for part, ended in zip(_ON_THE_WAY, tried, strict=True) if not ended.converged), None
        )
        if failed is None:
            break
        part, ended = failed
        together *= part * _SHORTER * (ended.path if 0.0 < ended.path < 1.0 else 1.0)
    return together if together == 1.0 else _SAFE * together


def skeleton(u: np.ndarray, count: int) -> np.ndarray:
    """`count` (or all) indices into u (m, n_a), in the order of a walk: the row nearest to rest (u = 0), and again and
    again the row farthest from those chosen."""
    return walk(u, spread(u, count, int(np.argmin((u**2).sum(axis=1)))))


def shards(u: np.ndarray, indices: np.ndarray, size: int) -> list[np.ndarray]:
    """The rows `indices` of u in boxes of at most `size` rows, the rows of each in the order of a walk. Boxes come from
    halving at the median of the widest side."""
    if len(indices) == 0:
        return []
    if len(indices) <= size:
        return [walk(u, indices)]
    side = int(np.argmax(np.ptp(u[indices], axis=0)))
    ordered = indices[np.argsort(u[indices, side], kind="stable")]
    middle = len(ordered) // 2
    return shards(u, ordered[:middle], size) + shards(u, ordered[middle:], size)


def walk(u: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """Path through `indices` from the row nearest to rest on, always to the nearest row not yet visited."""
    unvisited = list(indices)
    step = int(np.argmin((u[unvisited] ** 2).sum(axis=1)))
    path = [unvisited.pop(step)]
    while unvisited:
        step = int(np.argmin(((u[unvisited] - u[path[-1]]) ** 2).sum(axis=1)))
        path.append(unvisited.pop(step))
    return np.array(path)
