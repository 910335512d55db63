"""The filter of what moves of a C folder compiled on this machine, as a Python object, and its difference from
Python's."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.export import c_motion, c_swing
from cfem.export.c_estimate import status_of
from cfem.export.compiled import CORE, FAST, defines_of, library, struct_of
from cfem.export.compiled_estimate import SOURCES as ESTIMATE
from cfem.motion.marker_filter import MarkerFilter

SOURCES = (*c_swing.CORE, *ESTIMATE, *c_motion.CORE, *CORE)


@dataclass(frozen=True)
class Swung:
    """x (n,), covariance (n, n) of what markers tell; effector (n_e,) mm from rest; left_out, unseen: bits; status,
    iterations: as in C."""

    x: np.ndarray
    covariance: np.ndarray
    effector: np.ndarray
    noise: float
    left_out: int
    unseen: int
    status: int
    iterations: int


class CompiledSwing:
    """One robot's filter."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        names = ("cfem_estimate_data.h", "cfem_swing_data.h", "cfem_motion_data.h")
        size = defines_of("".join((folder / name).read_text(encoding="utf-8") for name in names))
        n, n_a, m = (int(size[name]) for name in ("CFEM_SWING_N", "CFEM_ESTIMATE_NA", "CFEM_ESTIMATE_MARKERS"))
        n_z, n_x, n_w = (int(size[f"CFEM_SWING_{name}"]) for name in ("NZ", "NX", "LOADS"))
        n_q, real = int(size["CFEM_MOTION_NQ"]), ctypes.c_double
        frame = {"place": 3 * m, "displacement": n_a, "force": n_a, "command": n_a}
        found = {"x": n, "covariance": n * n, "effector": int(size["CFEM_ESTIMATE_NE"]), "noise": 1}
        bits = [("left_out", ctypes.c_uint32), ("unseen", ctypes.c_uint32), ("status", ctypes.c_uint)]
        self._frame = struct_of([(name, real * count) for name, count in frame.items()])()
        doubles = [(name, real * count) for name, count in found.items()]
        self._found = struct_of([*doubles, *bits, ("iterations", ctypes.c_int)])()
        self._filter = (real * (n_z + n_q + n_a + n_w + 1 + n_x * n_x + n_z * n_a + 2))()
        self.rows = int(size["CFEM_ESTIMATE_ROWS"])
        self._library = library(folder, SOURCES, flags)
        self.reset()

    def reset(self) -> None:
        self._library.cfem_swing_init(self._filter)

    def frame(self, **measured: np.ndarray) -> Swung:
        """place (m, 3), displacement, force, command (n_a,): nan for what is not measured or known."""
        for name, values in measured.items():
            getattr(self._frame, name)[:] = np.ravel(values).tolist()
        self._library.cfem_swing_frame(self._filter, ctypes.byref(self._frame), ctypes.byref(self._found))
        one, n = self._found, len(self._found.x)
        arrays = np.array(one.x), np.array(one.covariance).reshape(n, n), np.array(one.effector)
        return Swung(*arrays, one.noise[0], one.left_out, one.unseen, one.status, one.iterations)

    def modes(self, x: np.ndarray) -> np.ndarray:
        """(k,) mm of the skin where the unknowns are x (n,)."""
        found = (ctypes.c_double * self.rows)()
        self._library.cfem_swing_modes((ctypes.c_double * len(x))(*x.tolist()), found)
        return np.array(found)


def swing_parity(folder: Path, made: MarkerFilter, period: float) -> float:
    """The largest difference of unknowns and standard deviations from Python's over their scale, and of the effectors
    over the first's; inf where a status differs."""
    compiled, largest = CompiledSwing(folder), 0.0
    for one in c_swing.swinging_frames(made, period):
        answer, x, P = one.pop("answer"), one.pop("x"), one.pop("covariance")
        found = compiled.frame(**one)
        if found.status != status_of(answer.status):
            return float("inf")
        off = [found.x - x, np.sqrt(np.diag(found.covariance)) - np.sqrt(np.diag(P))]
        largest = max(largest, *(float(np.abs(part / made.scale).max()) for part in off))
        largest = max(largest, float(np.abs(found.effector - answer.delta_e).max() / made.scale[0]))
    return largest
