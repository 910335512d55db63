"""Contact of a C folder, compiled on this machine, as a Python object."""

import ctypes
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.contact.obstacle import Rounded
from cfem.export.compiled.build import FAST, library
from cfem.export.compiled.structures import numbers, structures


@dataclass(frozen=True)
class TouchedInC:
    """One state: status as in cfem_touch.h, and the rest as `cfem.predict.contact.step.state.ContactState`; holds (N,):
    whether friction holds each patch."""

    status: int
    iterations: int
    systems: int
    patches: np.ndarray
    obstacles: np.ndarray
    modes: np.ndarray
    forces: np.ndarray
    normals: np.ndarray
    gaps: np.ndarray
    rows: np.ndarray
    delta_e: np.ndarray
    delta_a: np.ndarray
    lambda_a: np.ndarray
    error: float
    deep: bool
    unsettled: bool
    outside: bool
    everywhere: np.ndarray
    stuck: np.ndarray
    holds: np.ndarray


class CompiledTouch:
    """cfem_touch of a folder. Each step begins where the last one that converged ended; `reset` begins from the free
    robot."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        types = structures(folder, "cfem_touch.h")
        state, self._body = types["cfem_touched"], types["cfem_obstacle"]
        self._states, self._before = (state(), state()), None
        self.n_a = len(self._states[0].delta_a)
        self.library = library(folder, flags)
        self._room = (ctypes.c_byte * ctypes.c_ulong.in_dll(self.library, "cfem_touch_room_size").value)()

    def reset(self) -> None:
        self._before = None

    def __call__(
        self, delta_a: np.ndarray, obstacles: Sequence[Rounded], mu: float = 0.0, slack: bool = False
    ) -> TouchedInC:
        """State with the actuators at delta_a (n_a,) mm. slack: whether cables go slack (cfem_touch_slack)."""
        now, given = self.given(delta_a, obstacles, mu)
        status = (self.library.cfem_touch_slack if slack else self.library.cfem_touch)(*given)
        if not status:
            self._before = now
        c = now.count
        return TouchedInC(
            status,
            now.iterations,
            now.systems,
            *(np.array(values)[:c] for values in (now.patch, now.obstacle, now.mode)),
            *(np.array(values)[:c] for values in (now.force, now.normal, now.gap)),
            *(np.array(values) for values in (now.rows, now.delta_e, now.delta_a, now.lambda_a)),
            now.error,
            bool(now.deep),
            bool(now.unsettled),
            bool(now.outside),
            *(np.array(values) for values in (now.place, now.stuck)),
            np.array(now.holds, dtype=bool),
        )

    def seconds(self, delta_a: np.ndarray, obstacles: Sequence[Rounded], mu: float, count: int) -> float:
        """Processor time of a step from where the last one ended, the mean of `count`."""
        _, given = self.given(delta_a, obstacles, mu)
        begin = time.process_time()
        for _ in range(count):
            self.library.cfem_touch(*given)
        return (time.process_time() - begin) / count

    def given(self, delta_a: np.ndarray, obstacles: Sequence[Rounded], mu: float) -> tuple[ctypes.Structure, tuple]:
        """The state that a step fills, and its arguments."""
        bodies = (self._body * max(len(obstacles), 1))()
        for body, obstacle in zip(bodies, obstacles, strict=False):
            for name in ("R", "t", "core"):
                numbers(getattr(body, name))[...] = getattr(obstacle, name)
            body.rounding, body.below = obstacle.rounding, bool(np.isinf(obstacle.core[0]))
        now = self._states[1] if self._before is self._states[0] else self._states[0]
        before = ctypes.byref(self._before) if self._before else None
        deltas = (ctypes.c_double * self.n_a)(*np.asarray(delta_a, float).tolist())
        friction = ctypes.c_double(mu)
        return now, (deltas, bodies, len(obstacles), friction, before, ctypes.byref(now), ctypes.byref(self._room))
