"""Identity of markers: by its place, whatever it is called.

Three markers that are seen and three places whose mutual distances agree lay the frame; all others are then given to
the nearest places (Hungarian method), and the choice that explains most markers best wins. Labels decide between
choices that fit alike."""

from itertools import permutations

import numpy as np
from scipy.optimize import linear_sum_assignment

from cfem.core.errors import InputError
from cfem.identify.recordings.registration import best_motion

_ALIKE = 1.5  # ratio of residuals up to which two choices fit alike


_Rank = tuple[int, int, int, float]  # unnamed markers, misfit in steps, labels that disagree, misfit: less is better


def name_markers(
    seen: np.ndarray, labels: tuple[str, ...], places: dict[str, np.ndarray], tolerance: float, source: str
) -> dict[str, int]:
    """Number of the marker seen, by name, without those that are hidden. InputError where no choice of at least three
    fits within `tolerance` mm.

    seen:   (m, 3) mm, nan where hidden
    labels: (m,) as the cameras' software names them
    places: mm by name, in another frame"""
    rank, numbers = _best(seen, labels, places, tolerance)
    visible = int(np.isfinite(seen).all(axis=1).sum())
    if len(numbers) < min(visible, len(places)):
        _, mirrored = _best(seen * [1.0, 1.0, -1.0], labels, places, tolerance)
        if len(mirrored) > len(numbers):
            what = (
                f"its frame is left-handed: {len(mirrored)} of its markers are at their places after mirroring, "
                f"{len(numbers)} without"
            )
            raise InputError(what, where=source, do="export it again with right-handed axes: one has its sign wrong")
    if rank is None:
        what = f"no three of its {visible} markers lie as three of {', '.join(places)} should, to {tolerance:g} mm"
        do = "check places and unit, or allow more by registration.tolerance"
        raise InputError(what, where=source, do=do)
    return numbers


def _best(
    seen: np.ndarray, labels: tuple[str, ...], places: dict[str, np.ndarray], tolerance: float
) -> tuple[_Rank | None, dict[str, int]]:
    """Rank of the best choice, None where there is none, and the choice."""
    names, goals = list(places), np.array(list(places.values()))
    visible = np.flatnonzero(np.isfinite(seen).all(axis=1))
    best_rank, best = None, {}
    for triple in _triples(goals):
        corners = goals[list(triple)]
        sides = _sides(corners)
        for chosen in permutations(visible, 3):
            if np.abs(_sides(seen[list(chosen)]) - sides).max() > 2 * tolerance:
                continue
            pairs = _paired(seen[visible], goals, best_motion(seen[list(chosen)], corners), tolerance)
            if pairs is None:
                continue
            markers, numbers = visible[pairs[:, 0]], pairs[:, 1]
            turn, shift = best_motion(seen[markers], goals[numbers])
            misfit = np.sqrt(((seen[markers] @ turn.T + shift - goals[numbers]) ** 2).sum(axis=1).mean())
            agreeing = sum(labels[i].lower().endswith(names[j].lower()) for i, j in zip(markers, numbers, strict=True))
            step = round(np.log(max(misfit, 0.05 * tolerance)) / np.log(_ALIKE))
            rank = (-len(pairs), step, -agreeing, float(misfit))
            if best_rank is None or rank < best_rank:
                best_rank, best = rank, {names[j]: int(i) for i, j in zip(markers, numbers, strict=True)}
        if best_rank is not None and -best_rank[0] == min(len(visible), len(names)):
            break  # every marker has a name
    return best_rank, best


def _paired(
    seen: np.ndarray, goals: np.ndarray, motion: tuple[np.ndarray, np.ndarray], tolerance: float
) -> np.ndarray | None:
    """Pairs (k, 2) of numbers of markers and places, by a first motion and again by that of all that it paired; None
    where either pairs fewer than three."""
    for _ in range(2):
        turn, shift = motion
        pairs = _nearest_pairs(seen @ turn.T + shift, goals, tolerance)
        if len(pairs) < 3:
            return None
        motion = best_motion(seen[pairs[:, 0]], goals[pairs[:, 1]])
    return pairs


def follow(points: np.ndarray, within: float) -> np.ndarray:
    """Points (n, m, 3) as given, each marker's track mended where two change names from one frame to the next by jumps
    of more than `within` mm. A marker keeps its last place while it is hidden."""
    tracks, last = points.copy(), points[0].copy()
    for i in range(1, len(points)):
        seen_twice = np.flatnonzero(np.isfinite(tracks[i]).all(axis=1) & np.isfinite(last).all(axis=1))
        jumps = np.linalg.norm(tracks[i, seen_twice] - last[seen_twice], axis=1)
        if (jumps > within).sum() > 1:
            distances = np.linalg.norm(last[seen_twice][:, None] - tracks[i, seen_twice], axis=2)
            rows, columns = linear_sum_assignment(distances)
            if distances[rows, columns].sum() < 0.5 * np.trace(distances):
                tracks[i:, seen_twice[rows]] = tracks[i:, seen_twice[columns]]
        last = np.where(np.isfinite(tracks[i]), tracks[i], last)
    return tracks


def _triples(places: np.ndarray) -> list[tuple[int, ...]]:
    """Triples of places, those that span the largest triangles first; each place is in some."""
    n = len(places)
    if n < 3:
        return []
    triples = [(i, j, k) for i in range(n) for j in range(i) for k in range(j)]
    area = [np.linalg.norm(np.cross(places[i] - places[k], places[j] - places[k])) for i, j, k in triples]
    return [triples[i] for i in np.argsort(area)[::-1][:40]]


def _sides(corners: np.ndarray) -> np.ndarray:
    return np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)


def _nearest_pairs(moved: np.ndarray, places: np.ndarray, tolerance: float) -> np.ndarray:
    """Pairs (k, 2) of markers seen and places, at the least sum of distances."""
    distances = np.linalg.norm(moved[:, None] - places, axis=2)
    rows, columns = linear_sum_assignment(distances)
    near = distances[rows, columns] <= 3 * tolerance
    return np.column_stack([rows, columns])[near]
