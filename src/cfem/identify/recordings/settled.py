"""Stretches of a recording in which nothing moves."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError
from cfem.identify.recordings.recording import MarkerRecording

_SEEN = 0.5  # share of frames in which a marker must be seen to count


@dataclass(frozen=True)
class RestingFrames:
    """Frames in which m markers rest.

    first, end: from frame `first` to before `end`
    mean:  (m, 3) mm, nan where a marker was hardly seen
    sd:    (m, 3) mm noise about a straight line in time
    drift: (m,) mm from beginning to end along that line"""

    first: int
    end: int
    mean: np.ndarray
    sd: np.ndarray
    drift: np.ndarray


def settled(recording: MarkerRecording, window: float, within: float) -> list[RestingFrames]:
    """Stretches of at least `window` s in which each marker stays within `within` mm of its mean over any `window`, in
    order. InputError where the recording never settles, saying how near it came."""
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
        calmest = recording.time[best]
        do = f"allow more by settle.within (now {within:g} mm; calmest at {calmest:.2f} s), or record longer"
        raise InputError(what, where=recording.source, do=do)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], calm.astype(int), [0]])))
    return [_rest(recording, int(first), int(last) + count - 1) for first, last in edges.reshape(-1, 2)]


def _moves(points: np.ndarray, count: int) -> np.ndarray:
    """Largest distance (n - count + 1,) mm, in each window, of any marker from its mean, of those that are seen in half
    of it."""
    visible = np.isfinite(points).all(axis=2)
    filled = np.where(visible[..., None], points, 0.0)
    windows = np.lib.stride_tricks.sliding_window_view(filled, count, axis=0)
    seen = np.lib.stride_tricks.sliding_window_view(visible, count, axis=0)
    weight = np.maximum(seen.sum(axis=2), 1)
    mean = windows.sum(axis=3) / weight[..., None]
    largest = np.zeros(len(windows))
    for step in range(count):
        distance = np.linalg.norm(windows[..., step] - mean, axis=2) * seen[..., step]
        largest = np.maximum(largest, np.where(seen.mean(axis=2) >= _SEEN, distance, 0.0).max(axis=1))
    return largest


def _rest(recording: MarkerRecording, first: int, end: int) -> RestingFrames:
    """Mean, noise and drift of the markers that are seen in half of these frames."""
    points, time = recording.points[first:end], recording.time[first:end]
    visible = np.isfinite(points).all(axis=2)
    m = points.shape[1]
    mean, sd, drift = np.full((m, 3), np.nan), np.full((m, 3), np.nan), np.full(m, np.nan)
    for i in range(m):
        seen = visible[:, i]
        if seen.mean() >= _SEEN and seen.sum() >= 3:
            x, t = points[seen, i], time[seen] - time[seen].mean()
            slope = t @ x / (t @ t)
            mean[i], sd[i] = x.mean(axis=0), (x - t[:, None] * slope).std(axis=0, ddof=2)
            drift[i] = np.linalg.norm(slope) * np.ptp(t)
    return RestingFrames(first, end, mean, sd, drift)
