"""A recording of markers over time, whatever wrote it."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError


@dataclass(frozen=True)
class MarkerRecording:
    """A recording of n frames of m markers.

    time:   (n,) s
    labels: (m,) as the cameras' software names them
    points: (n, m, 3) mm, nan where a marker was not seen
    source: the file"""

    time: np.ndarray
    labels: tuple[str, ...]
    points: np.ndarray
    source: str

    @property
    def rate(self) -> float:
        """Rate, frames a second."""
        return float((len(self.time) - 1) / (self.time[-1] - self.time[0]))


def make_recording(time: np.ndarray, labels: list[str], points: np.ndarray, source: str) -> MarkerRecording:
    """A recording of the markers that were seen at all. InputError where there are fewer than two frames or no
    markers, or time does not run."""
    if len(time) < 2 or not labels:
        raise InputError("holds no frames of markers", where=source, do="export the markers' positions")
    if not (np.diff(time) > 0).all():
        raise InputError("its time does not run forward", where=source, do="export the recording again")
    seen = np.isfinite(points).all(axis=2).any(axis=0)
    if not seen.any():
        raise InputError("no marker is seen in any frame", where=source)
    chosen = np.flatnonzero(seen)
    return MarkerRecording(time, tuple(labels[i] for i in chosen), points[:, chosen], source)
