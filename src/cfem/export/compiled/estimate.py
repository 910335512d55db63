"""The estimator of a C folder compiled on this machine, as a Python object, and its difference from Python's."""

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.export.compiled.controller import FAST, defines_of, library, struct_of
from cfem.export.firmware.estimate import moving_frames, status_of
from cfem.predict.estimation.filter import Filter

MEASURED = ("place", "displacement", "force", "command")


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


class Compiled:
    """What both filters are asked and answer. sizes: those of cfem_estimate_data.h; n: unknowns."""

    def __init__(self, sizes: Mapping[str, str], n: int):
        n_a, n_e, m = (int(sizes[f"CFEM_ESTIMATE_{name}"]) for name in ("NA", "NE", "MARKERS"))
        self._frame = struct_of(_doubles(place=3 * m, displacement=n_a, force=n_a, command=n_a))()
        doubles = _doubles(x=n, covariance=n * n, effector=n_e, noise=1)
        bits = [("left_out", ctypes.c_uint32), ("unseen", ctypes.c_uint32), ("status", ctypes.c_uint)]
        self._found = struct_of([*doubles, *bits, ("iterations", ctypes.c_int)])()
        self._modes = (ctypes.c_double * int(sizes["CFEM_ESTIMATE_ROWS"]))()

    def _asked(self, call: Callable[..., Any], measured: dict[str, np.ndarray], *before: Any) -> Found:
        """call(*before, frame, found)."""
        for name, values in measured.items():
            getattr(self._frame, name)[:] = np.ravel(values).tolist()
        call(*before, ctypes.byref(self._frame), ctypes.byref(self._found))
        one, n = self._found, len(self._found.x)
        arrays = np.array(one.x), np.array(one.covariance).reshape(n, n), np.array(one.effector)
        return Found(*arrays, one.noise[0], one.left_out, one.unseen, one.status, one.iterations)

    def _shape(self, call: Callable[..., Any], x: np.ndarray) -> np.ndarray:
        call((ctypes.c_double * len(x))(*x.tolist()), self._modes)
        return np.array(self._modes)


class CompiledEstimator(Compiled):
    """tick: the filter; alone: one frame by itself."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        sizes = defines_of((folder / "cfem_estimate_data.h").read_text(encoding="utf-8"))
        super().__init__(sizes, int(sizes["CFEM_ESTIMATE_N"]))
        self._filter = ctypes.create_string_buffer(ctypes.sizeof(self._found) + 8 * len(self._frame.force) + 40)
        self._library = library(folder, flags)
        self.reset()

    def reset(self) -> None:
        self._library.cfem_filter_init(self._filter)

    def tick(self, **measured: np.ndarray) -> Found:
        """place (m, 3), displacement, force, command (n_a,): nan for what is not measured or known."""
        return self._asked(self._library.cfem_filter_tick, measured, self._filter)

    def alone(self, **measured: np.ndarray) -> Found:
        """As `tick`, of this frame by itself."""
        return self._asked(self._library.cfem_estimate_frame, measured)

    def modes(self, x: np.ndarray) -> np.ndarray:
        """(k,) mm of the skin where the unknowns are x (n,)."""
        return self._shape(self._library.cfem_estimate_modes, x)


def estimate_parity(folder: Path, made: Filter) -> float:
    """`difference` of the estimator in a C folder. A frame that none can estimate counts by its status alone."""
    return difference(moving_frames(made), CompiledEstimator(folder).tick, made.estimator.scale, whole=False)


def difference(frames: list[dict[str, Any]], ask: Callable[..., Found], scale: np.ndarray, whole: bool = True) -> float:
    """The largest difference of unknowns and standard deviations from Python's over their scale, and of the effectors
    over the first's; inf where a status differs. whole: those whose status is not 0 too."""
    most = 0.0
    for one in frames:
        found, answer = ask(**{name: one[name] for name in MEASURED}), one["answer"]
        if found.status != status_of(answer.status):
            return np.inf
        if found.status and not whole:
            continue
        apart = [found.x - one["x"], np.sqrt(np.diag(found.covariance)) - np.sqrt(np.diag(one["covariance"]))]
        ends = np.abs(found.effector - answer.delta_e).max() / scale[0]
        most = max(most, float(np.abs(np.array(apart) / scale).max()), float(ends))
    return most


def _doubles(**sizes: int) -> list[tuple[str, type]]:
    return [(name, ctypes.c_double * size) for name, size in sizes.items()]
