"""Contact of a C folder, compiled on this machine, as a Python object."""

import ctypes
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.contact.obstacle import Rounded
from cfem.export.compiled.controller import FAST, defines_of, library, struct_of


@dataclass(frozen=True)
class TouchedInC:
    """One state: status as in cfem_touch.h, and the rest as `cfem.predict.contact.state.ContactState`; holds (N,):
    whether friction holds each patch."""

    status: int
    iterations: int
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
    bending: float
    deep: bool
    everywhere: np.ndarray
    stuck: np.ndarray
    holds: np.ndarray


class CompiledTouch:
    """cfem_touch of a folder. Each step begins where the last one that converged ended; `reset` begins from the free
    robot."""

    def __init__(self, folder: Path, flags: tuple[str, ...] = FAST):
        text = "".join((folder / name).read_text(encoding="utf-8") for name in ("cfem_data.h", "cfem_touch_data.h"))
        defines = defines_of(text)
        most = int(defines["CFEM_TOUCH_MOST"])
        n, k = int(defines["CFEM_PATCHES"]), int(defines["CFEM_PATCH_ROWS"])
        self.n_a, n_e = int(defines["CFEM_NA"]), int(defines["CFEM_NE"])
        numbers, real = ctypes.c_int * most, ctypes.c_double

        counts = [("status", ctypes.c_uint), ("count", ctypes.c_int), ("iterations", ctypes.c_int)]
        contacts = [("patch", numbers), ("obstacle", numbers), ("mode", numbers)]
        vectors = [("force", real * (3 * most)), ("normal", real * (3 * most)), ("gap", real * most)]
        robot = [
            ("rows", real * k),
            ("delta_e", real * n_e),
            ("delta_a", real * self.n_a),
            ("lambda_a", real * self.n_a),
            ("bending", real),
            ("deep", ctypes.c_int),
        ]
        patches = [("place", real * (3 * n)), ("stuck", real * (3 * n)), ("holds", ctypes.c_ubyte * n)]
        near = [("near_count", ctypes.c_int), ("near", numbers)]
        self.state = struct_of([*counts, *contacts, *vectors, *robot, *patches, *near])
        pose = [("R", real * 9), ("t", real * 3)]
        self._body = struct_of([*pose, ("core", real * 3), ("rounding", real), ("below", ctypes.c_int)])
        self._states, self._before = (self.state(), self.state()), None
        self.library = library(folder, flags)
        self._room = (ctypes.c_byte * ctypes.c_ulong.in_dll(self.library, "cfem_touch_room_size").value)()
        self._call = self.library.cfem_touch

    def reset(self) -> None:
        self._before = None

    def __call__(
        self, delta_a: np.ndarray, obstacles: Sequence[Rounded], mu: float = 0.0, slack: bool = False
    ) -> TouchedInC:
        """slack: whether cables go slack (cfem_touch_slack)."""
        now, given = self.given(delta_a, obstacles, mu)
        status = (self.library.cfem_touch_slack if slack else self._call)(*given)
        if not status:
            self._before = now
        c = now.count
        return TouchedInC(
            status,
            now.iterations,
            *(np.array(values)[:c] for values in (now.patch, now.obstacle, now.mode)),
            *(np.array(values).reshape(-1, 3)[:c] for values in (now.force, now.normal)),
            np.array(now.gap)[:c],
            *(np.array(values) for values in (now.rows, now.delta_e, now.delta_a, now.lambda_a)),
            now.bending,
            bool(now.deep),
            *(np.array(values).reshape(-1, 3) for values in (now.place, now.stuck)),
            np.array(now.holds, dtype=bool),
        )

    def seconds(self, delta_a: np.ndarray, obstacles: Sequence[Rounded], mu: float, count: int) -> float:
        """Processor time of a step from where the last one ended, the mean of `count`."""
        _, given = self.given(delta_a, obstacles, mu)
        begin = time.process_time()
        for _ in range(count):
            self._call(*given)
        return (time.process_time() - begin) / count

    def given(self, delta_a: np.ndarray, obstacles: Sequence[Rounded], mu: float) -> tuple[ctypes.Structure, tuple]:
        """The state that a step fills, and its arguments."""
        bodies = (self._body * max(len(obstacles), 1))()
        for body, one in zip(bodies, obstacles, strict=False):
            body.R[:], body.t[:], body.core[:] = one.R.ravel().tolist(), one.t.tolist(), one.core.tolist()
            body.rounding, body.below = one.rounding, bool(np.isinf(one.core[0]))
        now = self._states[1] if self._before is self._states[0] else self._states[0]
        before = ctypes.byref(self._before) if self._before else None
        at = (ctypes.c_double * self.n_a)(*np.asarray(delta_a, float).tolist())
        friction = ctypes.c_double(mu)
        return now, (at, bodies, len(obstacles), friction, before, ctypes.byref(now), ctypes.byref(self._room))
