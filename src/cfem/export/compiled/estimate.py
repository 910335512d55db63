"""The estimator of a C folder compiled on this machine, as a Python object, and its difference from Python's."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.export.compiled.build import FAST, defines_of, library
from cfem.export.compiled.structures import numbers, structures
from cfem.export.firmware.estimate import moving_frames, status_of
from cfem.predict.estimation.filter import Filter

MEASURED = ("place", "displacement", "force", "command")


@dataclass(frozen=True)
class EstimateInC:
    """Estimate of the C code.

    x, covariance: (n,) unknowns and (n, n)
    effector: (n_e,) mm from rest
    left_out, unseen: bits of markers and of unknowns
    status, iterations: as in C"""

    x: np.ndarray
    covariance: np.ndarray
    effector: np.ndarray
    noise: float
    left_out: int
    unseen: int
    status: int
    iterations: int


class CompiledFilter:
    """A filter of a folder, of markers at rest or in motion."""

    def __init__(self, folder: Path, header: str, names: tuple[str, str], flags: tuple[str, ...]):
        """names: types of the filter and of its estimate, in a header of the folder."""
        types, sizes = structures(folder, header), defines_of(folder / "cfem_estimate_data.h")
        self._filter, self._estimate = (types[name]() for name in names)
        self._frame = types["cfem_frame"]()
        self._modes = (ctypes.c_double * int(sizes["CFEM_ESTIMATE_ROWS"]))()
        self._library = library(folder, flags)
        self.reset()

    def _answer(self, call: Callable[..., Any], measured: dict[str, np.ndarray], *before: Any) -> EstimateInC:
        """Answer of a call in a frame; its arguments are those `before`, the frame and the estimate."""
        for name, values in measured.items():
            numbers(getattr(self._frame, name))[...] = values
        call(*before, ctypes.byref(self._frame), ctypes.byref(self._estimate))
        estimate = self._estimate
        arrays = np.array(estimate.x), np.array(estimate.covariance), np.array(estimate.effector)
        return EstimateInC(
            *arrays, estimate.noise, estimate.left_out, estimate.unseen, estimate.status, estimate.iterations
        )

    def _shape(self, call: Callable[..., Any], x: np.ndarray) -> np.ndarray:
        call((ctypes.c_double * len(x))(*x.tolist()), self._modes)
        return np.array(self._modes)


class CompiledEstimator(CompiledFilter):
    """The estimator of a robot at rest: `tick` is the filter, `alone` takes one frame by itself."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        super().__init__(folder, "cfem_estimate.h", ("cfem_filter", "cfem_estimate"), flags)

    def reset(self) -> None:
        self._library.cfem_filter_init(ctypes.byref(self._filter))

    def tick(self, **measured: np.ndarray) -> EstimateInC:
        """Estimate after the next frame. place (m, 3), displacement, force, command (n_a,): nan where not measured."""
        return self._answer(self._library.cfem_filter_tick, measured, ctypes.byref(self._filter))

    def alone(self, **measured: np.ndarray) -> EstimateInC:
        """Estimate from one frame by itself; arguments as of `tick`."""
        return self._answer(self._library.cfem_estimate_frame, measured)

    def modes(self, x: np.ndarray) -> np.ndarray:
        """Modes (k,) mm of the skin where the unknowns are x (n,)."""
        return self._shape(self._library.cfem_estimate_modes, x)


def estimate_parity(folder: Path, made: Filter) -> float:
    """`difference` of the estimator in a C folder. A frame that none can estimate counts by its status alone."""
    return difference(moving_frames(made), CompiledEstimator(folder).tick, made.estimator.scale, with_failed=False)


def difference(
    frames: list[dict[str, Any]], ask: Callable[..., EstimateInC], scale: np.ndarray, with_failed: bool = True
) -> float:
    """The largest difference of unknowns and standard deviations from Python's over their scale, and of the effectors
    over the first's; inf where a status differs. with_failed: frames whose status is not 0 count too."""
    most = 0.0
    for frame in frames:
        estimate, answer = ask(**{name: frame[name] for name in MEASURED}), frame["answer"]
        if estimate.status != status_of(answer.status):
            return np.inf
        if estimate.status and not with_failed:
            continue
        apart = [estimate.x - frame["x"], np.sqrt(np.diag(estimate.covariance)) - np.sqrt(np.diag(frame["covariance"]))]
        ends = np.abs(estimate.effector - answer.delta_e).max() / scale[0]
        most = max(most, float(np.abs(np.array(apart) / scale).max()), float(ends))
    return most
