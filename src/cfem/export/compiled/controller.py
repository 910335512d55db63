"""The controller of a C export compiled on this machine, as a Python object."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.export.compiled.build import library
from cfem.export.compiled.structures import structures


@dataclass(frozen=True)
class TickCommand:
    """What a tick commands: delta_a (n_a,) mm, lambda_a (n_a,) N, reference (n_e,) mm, status as in cfem.h, tick: its
    number."""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    reference: np.ndarray
    status: int
    tick: int


class CompiledController:
    """One robot's controller. n_a, n_e: its sizes."""

    def __init__(self, folder: Path):
        types = structures(folder, "cfem.h")
        self._input, self._output, self._model, self._state = (
            types[name]() for name in ("cfem_input", "cfem_output", "cfem_condensed", "cfem_controller")
        )
        self.n_a, self.n_e = len(self._model.delta_a), len(self._model.free_e)
        self._library = library(folder)
        self._references = [ctypes.byref(struct) for struct in (self._state, self._input, self._output)]
        self.reset()

    def reset(self) -> None:
        self._library.cfem_init(self._references[0])

    @property
    def moved(self) -> np.ndarray:
        """Correction (n_e,) mm by which the goal is moved."""
        return np.array(self._state.feedback.moved)

    @property
    def integral(self) -> float:
        """K_I of the last sample."""
        return self._state.feedback.integral

    def step(
        self,
        goal: np.ndarray,
        x_e: np.ndarray | None = None,
        tick: int = 0,
        delta_a: np.ndarray | None = None,
    ) -> TickCommand:
        """Command of a tick.

        goal: (n_e,) mm absolute
        x_e: (n_e,) mm absolute, the latest sample of the effectors
        tick: number of the command that the sample followed
        delta_a: (n_a,) mm for the observer that needs it"""
        self._input.goal[:] = goal.tolist()
        self._input.tick = tick
        if x_e is not None:
            self._input.x_e[:] = x_e.tolist()
        if delta_a is not None:
            self._input.delta_a[:] = delta_a.tolist()
        self._library.cfem_step(*self._references)
        out = self._output
        return TickCommand(np.array(out.delta_a), np.array(out.lambda_a), np.array(out.reference), out.status, out.tick)

    def model(self, s: np.ndarray) -> dict[str, np.ndarray]:
        """The members of cfem_condensed at s (n_a,), flat, and 'status'."""
        status = self._library.cfem_model(type(self._model.delta_a)(*s.tolist()), ctypes.byref(self._model))
        members = {name: np.array(getattr(self._model, name)).ravel() for name, _ in self._model._fields_}
        return members | {"status": status}
