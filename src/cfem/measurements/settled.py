"""Stretches of a recording in which nothing moves."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.measurements.recording import Recording

_SEEN = 0.5  # share of frames in which a marker must be seen to count


@dataclass(frozen=True)
class Stretch:
    """From frame `first` to before `end`. mean (m, 3) mm, nan where a marker was hardly seen; sd (m, 3) mm: the noise
    about a straight line in time; drift (m,) mm: how far it goes from beginning to end along that line."""

    first: int
    end: int
    mean: np.ndarray
    sd: np.ndarray
    drift: np.ndarray


def settled(recording: Recording, window: float, within: float) -> list[Stretch]:
    """All stretches of at least `window` s in which each marker stays within `within` mm of its mean over any `window`,
    in order. InputError where it never settles, saying how near it came."""
    count = round(window * recording.rate)
    if count < 3 or count > len(recording.time):
        lasts = recording.time[-1] - recording.time[0]
        what = f"lasts {lasts:.3g} s at {recording.rate:.4g} frames a second, and a window of {window:g} s"
        raise InputError(f"{what} does not fit", where=recording.source, do="choose another settle.window")
    moves = _moves(recording.points, count)
    calm = moves <= within
    if not calm.any():
        best = int(np.argmin(moves))
        what = f"never settles: within any {window:g} s a marker moves at least {moves[best]:.3g} mm from its mean"
        at = recording.time[best]
        do = f"allow more by settle.within (now {within:g} mm; calmest at {at:.2f} s), or record longer"
        raise InputError(what, where=recording.source, do=do)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], calm.astype(int), [0]])))
    return [_stretch(recording, int(a), int(b) + count - 1) for a, b in edges.reshape(-1, 2)]


def _moves(points: np.ndarray, count: int) -> np.ndarray:
    """(n - count + 1,) mm: of the windows, largest distance from its mean of any marker that is seen in half of it."""
    there = np.isfinite(points).all(axis=2)
    filled = np.where(there[..., None], points, 0.0)
    windows = np.lib.stride_tricks.sliding_window_view(filled, count, axis=0)
    seen = np.lib.stride_tricks.sliding_window_view(there, count, axis=0)
    weight = np.maximum(seen.sum(axis=2), 1)
    mean = windows.sum(axis=3) / weight[..., None]
    out = np.zeros(len(windows))
    for step in range(count):
        away = np.linalg.norm(windows[..., step] - mean, axis=2) * seen[..., step]
        out = np.maximum(out, np.where(seen.mean(axis=2) >= _SEEN, away, 0.0).max(axis=1))
    return out


def _stretch(recording: Recording, first: int, end: int) -> Stretch:
    points, time = recording.points[first:end], recording.time[first:end]
    there = np.isfinite(points).all(axis=2)
    m = points.shape[1]
    mean, sd, drift = np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.full(m, np.nan)
    for i in range(m):
        if there[:, i].mean() >= _SEEN and there[:, i].sum() >= 3:
            mine, t = points[there[:, i], i], time[there[:, i]] - time[there[:, i]].mean()
            slope = t @ mine / (t @ t)
            mean[i], sd[i] = mine.mean(axis=0), (mine - t[:, None] * slope).std(axis=0, ddof=2)
            drift[i] = np.linalg.norm(slope) * np.ptp(t)
    return Stretch(first, end, mean, sd, drift)
