"""The estimator of a C folder compiled on this machine, as a Python object, and its difference from Python's."""

import ctypes
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.export.c_estimate import moving_frames, status_of
from cfem.export.compiled import FAST, library, struct_of
from cfem.predict.estimate_filter import Filter

SOURCES = ("cfem_estimate.c", "cfem_estimate_fit.c", "cfem_estimate_series.c", "cfem_estimate_data.c")


@dataclass(frozen=True)
class Found:
    """x (n,), covariance (n, n), effector (n_e,) mm from rest; left_out, unseen: bits; status, iterations: as in C."""

    x: np.ndarray
    covariance: np.ndarray
    effector: np.ndarray
    noise: float
    left_out: int
    unseen: int
    status: int
    iterations: int


class CompiledEstimator:
    """tick: the filter; alone: one frame by itself."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        text = (folder / "cfem_estimate_data.h").read_text(encoding="utf-8")
        size = {name: int(value) for name, value in re.findall(r"#define CFEM_ESTIMATE_(\w+) (\d+)", text)}
        n, n_a, n_e, m = size["N"], size["NA"], size["NE"], size["MARKERS"]
        self._frame = struct_of(_doubles(place=3 * m, displacement=n_a, force=n_a, command=n_a))()
        doubles = _doubles(x=n, covariance=n * n, effector=n_e, noise=1)
        bits = [("left_out", ctypes.c_uint32), ("unseen", ctypes.c_uint32), ("status", ctypes.c_uint)]
        self._found = struct_of([*doubles, *bits, ("iterations", ctypes.c_int)])()
        self._filter = ctypes.create_string_buffer(ctypes.sizeof(self._found) + 8 * n_a + 16)
        self.rows = size["ROWS"]
        self._library = library(folder, SOURCES, flags)
        self.reset()

    def reset(self) -> None:
        self._library.cfem_filter_init(self._filter)

    def tick(self, **measured: np.ndarray) -> Found:
        """place (m, 3), displacement, force, command (n_a,): nan for what is not measured or known."""
        self._tell(measured)
        self._library.cfem_filter_tick(self._filter, ctypes.byref(self._frame), ctypes.byref(self._found))
        return self._answer()

    def alone(self, **measured: np.ndarray) -> Found:
        """As `tick`, of this frame by itself."""
        self._tell(measured)
        self._library.cfem_estimate_frame(ctypes.byref(self._frame), ctypes.byref(self._found))
        return self._answer()

    def modes(self, x: np.ndarray) -> np.ndarray:
        """(k,) mm of the skin where the unknowns are x (n,)."""
        found = (ctypes.c_double * self.rows)()
        self._library.cfem_estimate_modes((ctypes.c_double * len(x))(*x.tolist()), found)
        return np.array(found)

    def _tell(self, measured: dict[str, np.ndarray]) -> None:
        for name, values in measured.items():
            getattr(self._frame, name)[:] = np.ravel(values).tolist()

    def _answer(self) -> Found:
        one, n = self._found, len(self._found.x)
        arrays = np.array(one.x), np.array(one.covariance).reshape(n, n), np.array(one.effector)
        return Found(*arrays, one.noise[0], one.left_out, one.unseen, one.status, one.iterations)


def estimate_parity(folder: Path, made: Filter) -> float:
    """The largest difference of unknowns and standard deviations from Python's over their scale, and of the effectors
    over the first's; inf where a status differs."""
    compiled, most, scale = CompiledEstimator(folder), 0.0, made.estimator.scale
    names = ("place", "displacement", "force", "command")
    for one in moving_frames(made):
        found, answer = compiled.tick(**{name: one[name] for name in names}), one["answer"]
        if found.status != status_of(answer.status):
            return np.inf
        if found.status:
            continue
        apart = [found.x - one["x"], np.sqrt(np.diag(found.covariance)) - answer.deviation]
        ends = np.abs(found.effector - answer.delta_e).max() / scale[0]
        most = max(most, float(np.abs(np.array(apart) / scale).max()), float(ends))
    return most


def _doubles(**sizes: int) -> list[tuple[str, type]]:
    return [(name, ctypes.c_double * size) for name, size in sizes.items()]
