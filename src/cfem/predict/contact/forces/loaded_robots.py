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
    BEARS,
    ERROR,
    STORED,
    LoadResult,
    free_places,
    load_robots,
    relief,
    turned_compliance,
)
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.contact.surface.surfaces import Surfaces

NOTHING, UNKNOWN = np.zeros(0, dtype=np.int64), np.full(1, -1)


class Joined(NamedTuple):
    """Robots that are held, as compiled loops take them: kept for the next step, as `Surfaces.last`.

    free: `LoadedRobots.free`
    known: patches (c,), nothing else is said before they are
    shapes, numbers, triples: of `load_robots`
    counts: of points, modes, mixtures, effectors, and entries of `LoadResult.compliance`"""

    held: list[HeldRobot]
    free: np.ndarray
    known: np.ndarray = UNKNOWN
    shapes: np.ndarray = NOTHING
    numbers: np.ndarray = NOTHING
    triples: np.ndarray = NOTHING
    counts: tuple[int, ...] = ()


class LoadedRobots:
    """Robots (r) of a scene, with N patches.

    R (r, 3, 3), t (r, 3) mm: where they stand now
    held: of each robot, the robot with its surface free
    free: (N, 3) mm, places of all patches then, in the frames of their robots
    known (c,): patches, among all N, whose local motion is known, and that may bear forces
    forces (N, 3) N: on all patches, on_known (c, 3) N: on the known ones, in the scene's axes
    places: (N, 3) mm of all patches in the frames of their robots; what is local is known of the loaded ones alone"""

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
        self.surfaces, self.deltas, self.wrenches, self.R, self.t = surfaces, deltas, wrenches, R, t
        each = zip(surfaces.models, deltas, wrenches, strict=True)
        self.held = [held(*of_robot) for of_robot in each]
        self._sizes, self._pressed = np.zeros((len(self.held), 5)), np.zeros(surfaces.ends[-1], dtype=bool)
        self._joined = next(iter(surfaces.last), None)
        if self._joined is None or any(now is not then for now, then in zip(self.held, self._joined.held, strict=True)):
            self._joined = Joined(self.held, self._free())
        self.free = self._joined.free
        self.know(known, forces)

    @classmethod
    def of(cls, model: SurfaceModel, delta: np.ndarray, wrench: np.ndarray | None = None) -> "LoadedRobots":
        """One robot in its own frame."""
        nothing = NOTHING, np.zeros((len(model.patches), 3))
        return cls(Surfaces([model]), [delta], [wrench], np.eye(3)[None], np.zeros((1, 3)), *nothing)

    def _free(self) -> np.ndarray:
        """`free` of what is held."""
        surfaces = self.surfaces
        free = free_places(surfaces.shapes, surfaces.flat, surfaces.rest, joined(*(it.rows for it in self.held)))
        for robot, model, wrench, (a, b) in zip(
            self.held, surfaces.models, self.wrenches, pairwise(surfaces.ends), strict=True
        ):
            if wrench is not None:
                free[a:b] += moved_by_wrench(robot, model, wrench)
        return free

    def know(self, known: np.ndarray, forces: np.ndarray) -> None:
        """Other patches known, under forces (N, 3) N."""
        self.known, self.forces = known, forces
        if len(self._joined.known) != len(known) or not (self._joined.known == known).all():
            self._joined = self._with(known)
        self.surfaces.last[:] = [self._joined]
        count, modes, mixtures, effectors, entries = self._joined.counts
        self._loaded = LoadResult(
            *(np.empty(modes), np.empty(modes), np.empty(mixtures), np.empty((count, 3)), np.empty(entries)),
            *(np.empty(effectors), self._sizes, self._pressed, np.empty(3 * len(known))),
            np.zeros(len(self.held), dtype=np.int64),
        )
        self._put(forces[known], True)

    def _with(self, known: np.ndarray) -> "Joined":
        """What is held, with known patches (c,)."""
        surfaces, parts, shapes = self.surfaces, [], np.zeros((len(self.held), 6), dtype=np.int64)
        shapes[:, :4] = surfaces.shapes
        ends, numbers, entries = np.searchsorted(known, surfaces.ends).tolist(), surfaces.numbers[known], 0
        for shape, robot, (a, b) in zip(shapes, self.held, pairwise(ends), strict=True):
            points = robot.compliance_of(numbers[a:b])
            shape[4], shape[5] = b - a, -1 if points.triples is None else len(points.triples)
            parts.append((robot.numbers, points.numbers, points.triples))
            entries += 9 * (b - a) ** 2
        triples = [part[2] for part in parts if part[2] is not None]
        return Joined(
            *(self.held, self.free, known, shapes, joined(*(numbers for part in parts for numbers in part[:2]))),
            np.concatenate(triples) if triples else np.empty((0, 3), dtype=np.int64),
            (*surfaces.shapes.sum(axis=0).tolist(), entries),
        )

    def load(self, forces: np.ndarray) -> None:
        """Puts forces (c, 3) N on the known patches."""
        self.forces = np.zeros(self.forces.shape)
        self.forces[self.known] = forces
        self._put(forces, False)

    def _put(self, forces: np.ndarray, sloped: bool) -> None:
        """Puts forces (c, 3) N on the known patches; sloped: whether the compliance under them is asked for."""
        self.on_known, self._sloped = forces, sloped
        shapes, numbers, triples = self._joined.shapes, self._joined.numbers, self._joined.triples
        robots = shapes, numbers, triples, self.surfaces.flat, self.free
        load_robots(*robots, self.known, forces, self.R, sloped, self._loaded)

    @property
    def places(self) -> np.ndarray:
        return self._loaded.places

    @property
    def rows(self) -> list[np.ndarray]:
        """(k,) mm of the skin of each robot."""
        return [self._loaded.rows[a:b] for a, b in self.surfaces.mode_ends]

    @property
    def error(self) -> float:
        """Estimate of how far what forces do is off, a share of it, the largest of all robots and loads."""
        return float(self._loaded.sizes[:, ERROR].max())

    @property
    def stored(self) -> float:
        """N mm that the forces have stored beside what the actuators have."""
        return float(self._loaded.sizes[:, STORED].sum())

    def compliance(self, under_forces: bool) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of the known patches' places by the forces on them, symmetric; under_forces: as
        these have changed it, which without them is positive semidefinite."""
        if under_forces and not self._sloped:
            self._put(self.on_known, True)
        return turned_compliance(
            self._joined.shapes, self._joined.numbers, self._loaded.compliance, self.R, under_forces
        )

    def outputs(self) -> tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray], list[np.ndarray]]:
        """Displacements delta_e (n_e,) mm and forces lambda_a (n_a,) N of each robot; by how much (n_a,) N the forces
        on patches relieve the actuators, and how far (n_e,) mm they move the effectors."""
        delta_e, lambda_a, reliefs, moved, loaded = [], [], [], [], self._loaded
        effector, mode, mixture = 0, 0, 0
        for robot, (_, k, r, e), sizes in zip(
            self.held, self.surfaces.shapes.tolist(), loaded.sizes.tolist(), strict=True
        ):
            free_e, lam = robot.alone
            w, v = loaded.w[mode : mode + k], loaded.v[mixture : mixture + r]
            helped = (
                relief(robot.gradient, robot.compliance_slopes, *robot.cubic, w, v, *sizes[:2])
                if sizes[BEARS]
                else np.zeros(len(lam))
            )
            moved.append(loaded.moved[effector : effector + e])
            reliefs.append(helped)
            delta_e.append(free_e + moved[-1])
            lambda_a.append(lam - helped)
            effector, mode, mixture = effector + e, mode + k, mixture + r
        return delta_e, lambda_a, reliefs, moved


def moved_by_wrench(robot: HeldRobot, model: SurfaceModel, wrench: np.ndarray) -> np.ndarray:
    """(n, 3) mm by which a wrench (n_e,) on the effectors moves the points of a surface locally."""
    series, every = model.local_tip, np.arange(len(model.patches))
    local = wrench @ (robot.basis @ series.reshape(len(series), -1)).reshape(len(wrench), -1)
    return (model.turns(robot.rows, every) @ local.reshape(-1, 3, 1))[:, :, 0]
