"""The filter of what moves of a C folder compiled on this machine, as a Python object, and its difference from
Python's."""

import ctypes
from pathlib import Path

import numpy as np

from cfem.export.compiled.build import FAST
from cfem.export.compiled.estimate import CompiledFilter, EstimateInC, difference
from cfem.export.firmware import swing as c_swing
from cfem.motion.estimation.marker_filter import MarkerFilter


class CompiledSwing(CompiledFilter):
    """Filter of one robot, by its markers."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        super().__init__(folder, "cfem_swing.h", ("cfem_swing", "cfem_swing_found"), flags)

    def reset(self) -> None:
        self._library.cfem_swing_init(ctypes.byref(self._filter))

    def frame(self, **measured: np.ndarray) -> EstimateInC:
        """Estimate after the next frame. place (m, 3), displacement, force, command (n_a,): nan where not measured."""
        return self._answer(self._library.cfem_swing_frame, measured, ctypes.byref(self._filter))

    def modes(self, x: np.ndarray) -> np.ndarray:
        """Modes (k,) mm of the skin where the unknowns are x (n,)."""
        return self._shape(self._library.cfem_swing_modes, x)


def swing_parity(folder: Path, made: MarkerFilter, period: float) -> float:
    """`difference` of the filter in a C folder."""
    return difference(c_swing.swinging_frames(made, period), CompiledSwing(folder).frame, made.scale)
