"""Which marker is which: by its place, whatever it is called.

Three markers that are seen and three places whose mutual distances agree lay the frame; all others are then given to
the nearest places (Hungarian method), and the choice that explains most markers best wins. Labels decide between
choices that fit alike."""

from itertools import permutations

import numpy as np
from scipy.optimize import linear_sum_assignment

from cfem.core.errors import InputError

_ALIKE = 1.5  # ratio of residuals up to which two choices fit alike


def name_markers(
    seen: np.ndarray, labels: tuple[str, ...], places: dict[str, np.ndarray], tolerance: float, source: str
) -> dict[str, int]:
    """seen (m, 3) mm, nan where hidden; places: of each name, mm, in another frame. Name -> number of the marker seen,
    without those that are hidden. InputError where no choice of at least three fits within `tolerance` mm."""
    best, found = _best(seen, labels, places, tolerance)
    there = int(np.isfinite(seen).all(axis=1).sum())
    if len(found) < min(there, len(places)):
        _, more = _best(seen * [1.0, 1.0, -1.0], labels, places, tolerance)
        if len(more) > len(found):
            what = (
                f"its frame is left-handed: {len(more)} of its markers are at their places after mirroring, "
                f"{len(found)} without"
            )
            raise InputError(what, where=source, do="export it again with right-handed axes: one has its sign wrong")
    if best is None:
        what = f"no three of its {there} markers lie as three of {', '.join(places)} should, to {tolerance:g} mm"
        do = "check places and unit, or allow more by registration.tolerance"
        raise InputError(what, where=source, do=do)
    return found


def _best(
    seen: np.ndarray, labels: tuple[str, ...], places: dict[str, np.ndarray], tolerance: float
) -> tuple[tuple | None, dict[str, int]]:
    """Rank of the best choice, None where there is none, and the choice."""
    names, at = list(places), np.array(list(places.values()))
    there = np.flatnonzero(np.isfinite(seen).all(axis=1))
    best, found = None, {}
    for three in _triples(at):
        goal = at[list(three)]
        sides = _sides(goal)
        for chosen in permutations(there, 3):
            if np.abs(_sides(seen[list(chosen)]) - sides).max() > 2 * tolerance:
                continue
            turn, shift = _rigid(seen[list(chosen)], goal)
            for _ in range(2):  # once by three, then by all that were named
                pairs = _pairs(seen[there] @ turn.T + shift, at, tolerance)
                if len(pairs) < 3:
                    break
                mine, theirs = there[pairs[:, 0]], pairs[:, 1]
                turn, shift = _rigid(seen[mine], at[theirs])
            if len(pairs) < 3:
                continue
            left = np.sqrt(((seen[mine] @ turn.T + shift - at[theirs]) ** 2).sum(axis=1).mean())
            agree = sum(labels[i].lower().endswith(names[j].lower()) for i, j in zip(mine, theirs, strict=True))
            rank = (-len(pairs), round(np.log(max(left, 0.05 * tolerance)) / np.log(_ALIKE)), -agree, left)
            if best is None or rank < best:
                best, found = rank, {names[j]: int(i) for i, j in zip(mine, theirs, strict=True)}
        if best is not None and -best[0] == min(len(there), len(names)):
            break  # every marker has a name
    return best, found


def follow(points: np.ndarray, within: float) -> np.ndarray:
    """(n, m, 3): as given, each marker's track mended where two change names from one frame to the next by jumps of
    more than `within` mm. A marker keeps its last place while it is hidden."""
    out, last = points.copy(), points[0].copy()
    for i in range(1, len(points)):
        now = out[i]
        both = np.flatnonzero(np.isfinite(now).all(axis=1) & np.isfinite(last).all(axis=1))
        if len(both) > 1 and (np.linalg.norm(now[both] - last[both], axis=1) > within).sum() > 1:
            apart = np.linalg.norm(last[both][:, None] - now[both], axis=2)
            rows, columns = linear_sum_assignment(apart)
            if apart[rows, columns].sum() < 0.5 * np.trace(apart):
                out[i:, both[rows]] = out[i:, both[columns]]
                now = out[i]
        last = np.where(np.isfinite(now), now, last)
    return out


def _triples(at: np.ndarray) -> list[tuple[int, ...]]:
    """Of places, those that span the largest triangles first; each place is in some."""
    n = len(at)
    if n < 3:
        return []
    found = [(i, j, k) for i in range(n) for j in range(i) for k in range(j)]
    area = [np.linalg.norm(np.cross(at[i] - at[k], at[j] - at[k])) for i, j, k in found]
    return [found[i] for i in np.argsort(area)[::-1][:40]]


def _sides(three: np.ndarray) -> np.ndarray:
    return np.linalg.norm(three - np.roll(three, 1, axis=0), axis=1)


def _rigid(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    U, _, Vt = np.linalg.svd((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
    turn = U @ np.diag([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))]) @ Vt
    return turn, b.mean(axis=0) - turn @ a.mean(axis=0)


def _pairs(moved: np.ndarray, at: np.ndarray, tolerance: float) -> np.ndarray:
    """(k, 2) of markers seen and places, nearest to each other as a whole."""
    apart = np.linalg.norm(moved[:, None] - at, axis=2)
    rows, columns = linear_sum_assignment(apart)
    near = apart[rows, columns] <= 3 * tolerance
    return np.column_stack([rows, columns])[near]
