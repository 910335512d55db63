"""Predictive control of a C export compiled on this machine, as a Python object."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from cfem.export.compiled.build import library
from cfem.export.compiled.structures import numbers, structures


@dataclass(frozen=True)
class Sent:
    """Answer of a tick of predictive control.

    u: (n_a,) the command
    delta_a: (n_a,) mm, where the plan has the actuators at the tick's end
    status: as in cfem_mpc.h"""

    u: np.ndarray
    delta_a: np.ndarray
    status: int


class CompiledMpc:
    """One robot's controller. bytes: of its state."""

    def __init__(self, folder: Path):
        types = structures(folder, "cfem_mpc.h")
        self._input, self._output = types["cfem_mpc_input"](), types["cfem_mpc_output"]()
        self._library = library(folder)
        self.bytes = ctypes.c_ulong.in_dll(self._library, "cfem_mpc_bytes").value
        self._state, self._real = (ctypes.c_double * (self.bytes // 8 + 1))(), type(self._output.u)
        self.reset()

    def reset(self, delta_a: ArrayLike | None = None) -> None:
        """The robot stands still at delta_a (n_a,) mm, or at the start of the export."""
        self._library.cfem_mpc_init(self._state, None if delta_a is None else self._real(*np.asarray(delta_a, float)))

    def step(self, goals: ArrayLike, x_e: ArrayLike | None = None, sampled: int = 0) -> Sent:
        """Answer of a tick to goals (k, n_e) mm absolute, at the ends of the next ticks; x_e (n_e,) mm: the sample of
        tick number `sampled`, counted from 1."""
        goals = np.atleast_2d(np.asarray(goals, float))[: len(self._input.goal)]
        numbers(self._input.goal)[: len(goals)] = goals
        self._input.ahead, self._input.sampled = len(goals), sampled
        if x_e is not None:
            self._input.x_e[:] = np.asarray(x_e, float).tolist()
        status = self._library.cfem_mpc_step(self._state, ctypes.byref(self._input), ctypes.byref(self._output))
        return Sent(np.array(self._output.u), np.array(self._output.delta_a), status)
