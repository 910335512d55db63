"""Predictive control of a C export compiled on this machine, as a Python object."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cfem.export.compiled.controller import defines_of, library, struct_of


@dataclass(frozen=True)
class Sent:
    """u (n_a,): the command; delta_a (n_a,) mm: where the plan has the actuators at the tick's end; status: as in
    cfem_mpc.h."""

    u: np.ndarray
    delta_a: np.ndarray
    status: int


class CompiledMpc:
    """One robot's controller. bytes: of its state."""

    def __init__(self, folder: Path):
        found = defines_of("".join((folder / name).read_text() for name in ("cfem_motion_data.h", "cfem_mpc_data.h")))
        n_a, n_e = int(found["CFEM_MOTION_NA"]), int(found["CFEM_MOTION_NE"])
        self._ticks, real = int(found["CFEM_MPC_TICKS"]), ctypes.c_double
        goals = ("goal", real * n_e * self._ticks), ("ahead", ctypes.c_int)
        self._input = struct_of([*goals, ("x_e", real * n_e), ("sampled", ctypes.c_long)])()
        self._output = struct_of([("u", real * n_a), ("delta_a", real * n_a), ("status", ctypes.c_uint)])()
        self._library = library(folder)
        self.bytes = ctypes.c_ulong.in_dll(self._library, "cfem_mpc_bytes").value
        self._state, self._real = (ctypes.c_double * (self.bytes // 8 + 1))(), real * n_a
        self.reset()

    def reset(self, delta_a: ArrayLike | None = None) -> None:
        """The robot stands still at delta_a (n_a,) mm, or at the start of the export."""
        self._library.cfem_mpc_init(self._state, None if delta_a is None else self._real(*np.asarray(delta_a, float)))

    def step(self, goals: ArrayLike, x_e: ArrayLike | None = None, sampled: int = 0) -> Sent:
        """goals (k, n_e) mm absolute, at the ends of the next ticks; x_e (n_e,) mm: the sample of tick number
        `sampled`, counted from 1."""
        goals = np.atleast_2d(np.asarray(goals, float))[: self._ticks]
        for k, one in enumerate(goals):
            self._input.goal[k][:] = one.tolist()
        self._input.ahead, self._input.sampled = len(goals), sampled
        if x_e is not None:
            self._input.x_e[:] = np.asarray(x_e, float).tolist()
        status = self._library.cfem_mpc_step(self._state, ctypes.byref(self._input), ctypes.byref(self._output))
        return Sent(np.array(self._output.u), np.array(self._output.delta_a), status)
