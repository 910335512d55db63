"""Robots that meet in a C folder, compiled on this machine, as a Python object."""

import ctypes
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.contact.obstacle import Rounded
from cfem.export.compiled.build import FAST
from cfem.export.compiled.structures import structures
from cfem.export.compiled.touch import CompiledTouch


@dataclass(frozen=True)
class MetInC:
    """One state: status as in cfem_meet.h, and the rest as `cfem.predict.contact.step.state.ContactState`."""

    status: int
    iterations: int
    systems: int
    forces: np.ndarray
    places: np.ndarray
    pressed: float
    delta_e: list[np.ndarray]
    deltas: list[np.ndarray]
    lambda_a: list[np.ndarray]
    rows: list[np.ndarray]


class CompiledMeet:
    """cfem_meet of a folder, of the robots of its export. Each step begins where the last one that converged ended;
    `reset` begins where the robots begin."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        self._touch, types = CompiledTouch(folder, flags), structures(folder, "cfem_meet.h")
        self.library, state = self._touch.library, types["cfem_met"]
        self._states, self._before = (state(), state()), None
        room = (ctypes.c_ulong * 3).in_dll(self.library, "cfem_meet_sizes")[1]
        self._room = (ctypes.c_byte * room)()
        placed = types["cfem_placed"] * len(self._states[0].robot)
        self.placed = placed.from_buffer_copy(placed.in_dll(self.library, "cfem_robots"))
        self.library.cfem_meet_pressed.restype = ctypes.c_double

    def reset(self) -> None:
        self._before = None

    def __call__(self, deltas: Sequence[np.ndarray], obstacles: Sequence[Rounded] = (), mu: float = 0.0) -> MetInC:
        """State with actuators held at deltas, (n_a,) mm of each robot, among obstacles with friction mu."""
        now, given = self._arguments(deltas, obstacles, mu)
        status = self.library.cfem_meet(*given)
        if not status:
            self._before = now
        forces, places = [], []
        for robot, pose in zip(now.robot, self.placed, strict=True):
            local_forces = np.zeros((len(robot.place), 3))
            local_forces[robot.patch[: robot.count]] = np.array(robot.force)[: robot.count]
            forces.append(local_forces @ np.array(pose.R).T)
            places.append(np.array(robot.place))
        met = [(a, b) for a in range(len(places)) for b in range(a, len(places) + len(obstacles))]
        return MetInC(
            status,
            now.iterations,
            now.systems,
            np.concatenate(forces),
            np.concatenate(places),
            sum(self.library.cfem_meet_pressed(ctypes.byref(now), *pair) for pair in met),
            *(
                [np.array(getattr(robot, name)) for robot in now.robot]
                for name in ("delta_e", "delta_a", "lambda_a", "rows")
            ),
        )

    def seconds(self, deltas: Sequence[np.ndarray], obstacles: Sequence[Rounded], mu: float, count: int) -> float:
        """Processor time of a step from where the last one ended, the mean of `count`."""
        _, given = self._arguments(deltas, obstacles, mu)
        begin = time.process_time()
        for _ in range(count):
            self.library.cfem_meet(*given)
        return (time.process_time() - begin) / count

    def _arguments(self, deltas: Sequence[np.ndarray], obstacles: Sequence[Rounded], mu: float) -> tuple:
        """The state that a step fills, and its arguments."""
        _, (_, bodies, count, friction, *_) = self._touch.given(deltas[0], obstacles, mu)
        displacements = (ctypes.c_double * (len(deltas) * len(deltas[0])))(*np.concatenate(deltas).tolist())
        now = self._states[1] if self._before is self._states[0] else self._states[0]
        before = ctypes.byref(self._before) if self._before else None
        states = before, ctypes.byref(now), ctypes.byref(self._room)
        return now, (displacements, self.placed, bodies, count, friction, *states)
