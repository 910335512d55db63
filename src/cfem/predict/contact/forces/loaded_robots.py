"""Learned robots at held actuators, under forces on patches of their surfaces: one compliant system.

How the rows of a robot go is known to the second order in the load w on the modes of the skin:

    rows = rows_0 + C_ss w + Q D_ss[v, v] / 2 + ...        v = Q^T w

with the mixtures Q of the modes that matter to D (`SurfaceModel.bends`). The orders beyond follow as far as the energy
along the load tells them (`cfem.predict.contact.forces.high_order`). So do the dents, by which a force on a patch
changes what this patch yields. Nodes, which are close to each other, have joint dents instead
(`cfem.predict.contact.forces.joint_dents`). All of it is the derivative of one energy by the forces, so that the
compliance is symmetric.

A wrench on the effectors, such as weight, moves the rows to its second order, and changes their compliance to its
first."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cfem.predict.contact.forces.held_robot import HeldRobot, held, joined
from cfem.predict.contact.forces.load_kernel import (
    Answers,
    LoadResult,
    RobotArrays,
    answers,
    free_places,
    load_robots,
    turned_compliance,
)
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.contact.surface.surfaces import Surfaces

NOTHING = np.zeros(0, dtype=np.int64)


class Joined(NamedTuple):
    """Robots that are held, as compiled loops take them: kept for the next step, as `Surfaces.last`.

    given: bytes of `LoadedRobots.given`, and which robots are under a wrench
    free: `LoadedRobots.free`
    known: bytes of the patches (c,), nothing else is said before they are
    arrays: of compiled loops
    room: for what forces do, of one `LoadedRobots` at a time
    answers: `LoadedRobots.numbers`, once it has been asked for"""

    given: tuple[bytes, list[bool]]
    held: list[HeldRobot]
    free: np.ndarray
    known: bytes | None = None
    arrays: RobotArrays | None = None
    room: tuple[np.ndarray, ...] = ()
    answers: list[np.ndarray] | None = None


class LoadedRobots:
    """Robots (r) of a scene, with N patches.

    R (r, 3, 3), t (r, 3) mm: where they stand now
    held: of each robot, the robot with its surface free
    free: (N, 3) mm, places of all patches then, in the frames of their robots
    known (c,): patches, among all N, whose local motion is known, and that may bear forces
    forces: (N, 3) N on all patches, in the scene's axes
    given: displacements (sum of n_a,) mm of the actuators and then wrenches (sum of n_e,) on the effectors
    arrays: of compiled loops
    room: for what the forces do, which `loaded` has"""

    def __init__(
        self,
        surfaces: Surfaces,
        deltas: Sequence[np.ndarray],
        wrenches: Sequence[np.ndarray | None],
        R: np.ndarray,
        t: np.ndarray,
        known: np.ndarray,
        forces: np.ndarray,
    ):
        """At delta (n_a,) mm, under a constant wrench (n_e,) on its effectors, None: none, of each robot."""
        self.surfaces, self.wrenches, self.R, self.t = surfaces, wrenches, R, t
        self.given, under = np.concatenate([*deltas, surfaces.no_wrench]), [wrench is not None for wrench in wrenches]
        if any(under):
            each = zip(wrenches, surfaces.effector_ends, strict=True)
            self.given = np.concatenate([*deltas, *(np.zeros(b - a) if it is None else it for it, (a, b) in each)])
        key = self.given.tobytes(), under
        self._joined = next(iter(surfaces.last), None)
        if self._joined is None or self._joined.given != key:
            robots = [held(*of_robot) for of_robot in zip(surfaces.models, deltas, wrenches, strict=True)]
            self._joined = Joined(key, robots, self._free(robots))
        self.held, self.free = self._joined.held, self._joined.free
        self._sizes, self._pressed = np.zeros((len(wrenches), 5)), np.zeros(len(self.free), dtype=bool)
        self.know(known, forces)

    @classmethod
    def of(cls, model: SurfaceModel, delta: np.ndarray, wrench: np.ndarray | None = None) -> "LoadedRobots":
        """One robot in its own frame."""
        nothing = NOTHING, np.zeros((len(model.patches), 3))
        return cls(Surfaces([model]), [delta], [wrench], np.eye(3)[None], np.zeros((1, 3)), *nothing)

    def _free(self, robots: list[HeldRobot]) -> np.ndarray:
        """`free` of robots."""
        surfaces = self.surfaces
        free = free_places(surfaces.shapes, surfaces.flat, surfaces.rest, joined(*(it.rows for it in robots)))
        for robot, model, wrench, (a, b) in zip(
            robots, surfaces.models, self.wrenches, pairwise(surfaces.ends), strict=True
        ):
            if wrench is not None:
                free[a:b] += moved_by_wrench(robot, model, wrench)
        return free

    def know(self, known: np.ndarray, forces: np.ndarray) -> None:
        """Other patches known, under forces (N, 3) N."""
        if self._joined.known != known.tobytes():
            self._joined = self._with(known)
        self.surfaces.last[:] = [self._joined]
        self.arrays, begin = self._joined.arrays, np.zeros(len(self.held), dtype=np.int64)
        self.room = LoadResult(*self._joined.room, self._sizes, self._pressed, begin)
        self.known, self.forces = known, forces
        self._put, self._sloped = False, True

    def _with(self, known: np.ndarray) -> "Joined":
        """What is held, with known patches (c,)."""
        surfaces, parts, shapes = self.surfaces, [], np.zeros((len(self.held), 6), dtype=np.int64)
        shapes[:, :4] = surfaces.shapes
        ends, mine, entries = np.searchsorted(known, surfaces.ends).tolist(), surfaces.numbers[known], 0
        for shape, robot, (a, b) in zip(shapes, self.held, pairwise(ends), strict=True):
            points = robot.compliance_of(mine[a:b])
            shape[4], shape[5] = b - a, -1 if points.triples is None else len(points.triples)
            parts.append((robot.numbers, points.numbers, points.triples))
            entries += 9 * (b - a) ** 2
        triples = [part[2] for part in parts if part[2] is not None]
        numbers = joined(*(of_robot for part in parts for of_robot in part[:2]))
        joint = np.concatenate(triples) if triples else np.empty((0, 3), dtype=np.int64)
        arrays = RobotArrays(shapes, numbers, joint, surfaces.flat, self.free)
        points, modes, mixtures, effectors = surfaces.shapes.sum(axis=0).tolist()
        sizes = modes, modes, mixtures, (points, 3), entries, effectors, 3 * len(known)
        return self._joined._replace(
            known=known.tobytes(), arrays=arrays, room=tuple(np.empty(size) for size in sizes), answers=[]
        )

    def load(self, forces: np.ndarray) -> None:
        """Puts forces (c, 3) N on the known patches."""
        self.forces = np.zeros(self.forces.shape)
        self.forces[self.known] = forces
        self._put, self._sloped = False, False

    def have(self, forces: np.ndarray, sloped: bool) -> None:
        """Says that `room` has what forces (N, 3) N do; sloped: and the compliance under them."""
        self.forces, self._put, self._sloped = forces, True, sloped

    @property
    def on_known(self) -> np.ndarray:
        """(c, 3) N on the known patches, in the scene's axes."""
        return self.forces[self.known]

    @property
    def loaded(self) -> LoadResult:
        """Motion by the forces, computed when it is first asked for."""
        if not self._put:
            load_robots(self.arrays, self.known, self.on_known, self.R, self._sloped, self.room)
            self._put = True
        return self.room

    def slope(self) -> LoadResult:
        """Motion by the forces, and the compliance under them."""
        if not self._sloped:
            self._put, self._sloped = False, True
        return self.loaded

    @property
    def places(self) -> np.ndarray:
        """(N, 3) mm of all patches in the frames of their robots; what is local is known of the loaded ones alone."""
        return self.loaded.places

    @property
    def rows(self) -> list[np.ndarray]:
        """(k,) mm of the skin of each robot."""
        rows = self.loaded.rows
        return [rows[a:b] for a, b in self.surfaces.mode_ends]

    def compliance(self, under_forces: bool) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of the known patches' places by the forces on them, symmetric; under_forces: as
        these have changed it, which without them is positive semidefinite."""
        loaded = self.slope() if under_forces else self.loaded
        return turned_compliance(self.arrays, loaded.compliance, self.R, under_forces)

    @property
    def numbers(self) -> np.ndarray:
        """Those of `load_kernel.answers`."""
        kept = self._joined.answers
        if not kept:
            each = zip(self.held, self.arrays.shapes[:, 4].tolist(), strict=True)
            kept.append(joined(*(array for it, c in each for array in ((it.answers,) if c else it.alone))))
        return kept[0]

    @property
    def answers(self) -> Answers:
        return answers(self.arrays.shapes, self.surfaces.actuators, self.numbers, self.loaded)


def moved_by_wrench(robot: HeldRobot, model: SurfaceModel, wrench: np.ndarray) -> np.ndarray:
    """(n, 3) mm by which a wrench (n_e,) on the effectors moves the points of a surface locally."""
    series, every = model.local_tip, np.arange(len(model.patches))
    local = wrench @ (robot.basis @ series.reshape(len(series), -1)).reshape(len(wrench), -1)
    return (model.turns(robot.rows, every) @ local.reshape(-1, 3, 1))[:, :, 0]
