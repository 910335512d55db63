"""Trade-offs: designs of which no other is better in one objective without being worse in another."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from cfem.design.optimisers.search import Design, Grid, Scalar, best, refine
from cfem.design.problem import DesignProblem

_TILT = 1e-5  # weight of the other objectives at an end of the front


@dataclass(frozen=True)
class Front:
    """Designs of which none is better than another in all objectives.

    names, indices: (k,) of the objectives
    designs: in the order of the first objective
    corners: places of the ends, of the knee between them, where the front is farthest below the line between its ends,
        and of either side of where it jumps to other designs (two objectives)
    volume, grid_volume: hypervolumes of the front and of the grid's own (shares of the box between the best and the
        worst of the grid's)
    beaten: points of the grid that beat a design of the front"""

    names: tuple[str, ...]
    indices: tuple[int, ...]
    designs: tuple[Design, ...]
    corners: dict[str, int]
    volume: float
    grid_volume: float
    beaten: int


def pareto_front(
    problem: DesignProblem, grid: Grid, names: Sequence[str], points: int, ends: Sequence[Design]
) -> Front:
    """Pareto front of these objectives, of about `points` designs. ends: the best designs by each objective alone."""
    indices = [problem.names.index(name) for name in names]
    unit = np.eye(len(problem.objectives))[indices]
    # of designs that are equally good at one objective, the end is the best at the others
    tilted = unit + _TILT * unit.sum(axis=0)
    ends = [best(problem, grid, Scalar.weighted(row), 1, [end.z]) for row, end in zip(tilted, ends, strict=True)]
    corner = np.array([grid.hat(end.objectives)[indices] for end in ends])
    low, high = corner.min(axis=0), corner.max(axis=0)
    width = np.where(high > low, high - low, 1.0)
    hats = grid.hat(grid.scores.objectives)[:, indices]
    feasible = np.flatnonzero(grid.scores.feasible)
    designs_found = list(ends)
    last = ends[0].z
    for share in _lattice(points, len(indices)):
        # through the point of the simplex between the ends, along (1, ..., 1) in units of the ends' box
        scalar = Scalar(unit / width[:, None], (low / width) + share)
        start = grid.z[feasible[np.argmin(scalar(grid.hat(grid.scores.objectives[feasible])))]]
        refined = min((refine(problem, grid, scalar, z) for z in (start, last)), key=lambda design: design.value)
        designs_found.append(refined)
        last = refined.z
    objectives = np.array([design.objectives for design in designs_found])[:, indices]
    keep = [i for i in np.flatnonzero(non_dominated(objectives)) if not _repeats(objectives, i, grid.width[indices])]
    keep.sort(key=lambda i: objectives[i, 0])
    designs = tuple(designs_found[i] for i in keep)
    hat = grid.hat(np.array([design.objectives for design in designs]))[:, indices]
    z = np.array([design.z for design in designs])
    two = len(indices) == 2
    better = [
        ((hats[feasible] <= hat_of_design).all(axis=1) & (hats[feasible] < hat_of_design - 1e-9).any(axis=1)).sum()
        for hat_of_design in hat
    ]
    return Front(
        tuple(names),
        tuple(indices),
        designs,
        _corners(hat, z) if two else {name: int(np.argmin(hat[:, i])) for i, name in enumerate(names)},
        hypervolume(hat),
        hypervolume(hats[feasible][non_dominated(hats[feasible])]),
        int(sum(better)),
    )


def best_of_each(problem: DesignProblem, grid: Grid, starts: int) -> list[Design]:
    return [best(problem, grid, Scalar.weighted(row), starts) for row in np.eye(len(problem.objectives))]


def non_dominated(objectives: np.ndarray) -> np.ndarray:
    """Mask (m,): True for rows of objectives (m, k) than which no other row is as good in all and better in one."""
    keep = np.ones(len(objectives), dtype=bool)
    for i, row in enumerate(objectives):
        keep[i] = not ((objectives <= row).all(axis=1) & (objectives < row).any(axis=1)).any()
    return keep


def hypervolume(hat: np.ndarray) -> float:
    """Volume of the unit cube in which some row of hat (m, k) is at least as good, whatever is beyond (1, ..., 1) left
    out: by slices along the last objective (While et al., IEEE Trans. Evol. Comput. 10, 2006)."""
    inside = hat[(hat < 1).all(axis=1)]
    if not len(inside):
        return 0.0
    if hat.shape[1] == 2:
        inside = inside[np.argsort(inside[:, 0], kind="stable")]
        widths = np.diff(np.append(inside[:, 0], 1.0))
        return float((widths * (1.0 - np.minimum.accumulate(inside[:, 1]))).sum())
    inside = inside[np.argsort(inside[:, -1], kind="stable")]
    heights = np.diff(np.append(inside[:, -1], 1.0))
    return float(sum(h * hypervolume(inside[: i + 1, :-1]) for i, h in enumerate(heights) if h > 0))


def _repeats(objectives: np.ndarray, index: int, width: np.ndarray) -> bool:
    """True if an earlier row is the same to 1e-6 of the spread."""
    return bool((np.abs(objectives[:index] - objectives[index]) < 1e-6 * width).all(axis=1).any())


def jumps(z: np.ndarray) -> np.ndarray:
    """Places in the front (k, n) at which it goes over to other designs: half a range and more away."""
    return 1 + np.flatnonzero(np.abs(np.diff(z, axis=0)).max(axis=1) > 0.5)


def _corners(hat: np.ndarray, z: np.ndarray) -> dict[str, int]:
    """Numbers of the designs at the ends, the knee and the gaps of a front of two objectives."""
    first, last = hat[0], hat[-1]
    line = last - first
    below = line[0] * (hat[:, 1] - first[1]) - line[1] * (hat[:, 0] - first[0])
    knee = int(np.argmin(below))
    corners = {"first": 0, "last": len(hat) - 1} | ({"knee": knee} if 0 < knee < len(hat) - 1 else {})
    for number, place in enumerate(jumps(z)):
        label = f" {number + 1}" if number else ""
        corners |= {f"before gap{label}": int(place) - 1, f"after gap{label}": int(place)}
    return {name: place for i, (name, place) in enumerate(corners.items()) if place not in list(corners.values())[:i]}


def _lattice(points: int, k: int) -> list[np.ndarray]:
    """Inner points of the simplex of k shares (Das and Dennis, SIAM J. Optim. 8, 1998), about `points` of them, in the
    order in which neighbours follow each other where there are two."""
    if k == 2:
        return [np.array([share, 1 - share]) for share in np.linspace(0, 1, points + 2)[1:-1]]
    division = k
    while comb(division - 1, k - 1) < points:
        division += 1
    bars = combinations(range(1, division), k - 1)
    return [np.diff([0, *bar, division]) / division for bar in bars]
