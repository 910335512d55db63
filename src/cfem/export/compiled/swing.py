"""The filter of what moves of a C folder compiled on this machine, as a Python object, and its difference from
Python's."""

import ctypes
from pathlib import Path

import numpy as np

from cfem.export.compiled.controller import FAST, defines_of, library
from cfem.export.compiled.estimate import Compiled, Found, difference
from cfem.export.firmware import swing as c_swing
from cfem.motion.estimation.marker_filter import MarkerFilter


class CompiledSwing(Compiled):
    """One robot's filter; it answers with what markers tell."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        names = ("cfem_estimate_data.h", "cfem_swing_data.h", "cfem_motion_data.h")
        size = defines_of("".join((folder / name).read_text(encoding="utf-8") for name in names))
        super().__init__(size, int(size["CFEM_SWING_N"]))
        n_z, n_x, n_w = (int(size[f"CFEM_SWING_{name}"]) for name in ("NZ", "NX", "LOADS"))
        n_q, n_a = int(size["CFEM_MOTION_NQ"]), len(self._frame.force)
        self._filter = (ctypes.c_double * (n_z + n_q + n_a + n_w + 1 + n_x * n_x + n_z * n_a + 4))()
        self._library = library(folder, flags)
        self.reset()

    def reset(self) -> None:
        self._library.cfem_swing_init(self._filter)

    def frame(self, **measured: np.ndarray) -> Found:
        """place (m, 3), displacement, force, command (n_a,): nan for what is not measured or known."""
        return self._asked(self._library.cfem_swing_frame, measured, self._filter)

    def modes(self, x: np.ndarray) -> np.ndarray:
        """(k,) mm of the skin where the unknowns are x (n,)."""
        return self._shape(self._library.cfem_swing_modes, x)


def swing_parity(folder: Path, made: MarkerFilter, period: float) -> float:
    """`difference` of the filter in a C folder."""
    return difference(c_swing.swinging_frames(made, period), CompiledSwing(folder).frame, made.scale)
