"""A learned robot among obstacles, as a model that control plans with: contact is part of its answer.

Its rows are the effectors', and behind them, for each obstacle that is to be pressed, the force on it, and for each
that is to be avoided, the distance from it:

    <name>.force     N, the sum of normal forces; where nothing touches, minus what a patch would need to come so far
    <name>.distance  mm, of the whole surface (`cfem.predict.clearance`)

so that a goal of force is a goal of a row, and a distance to be kept a bound of a row. What is avoided does not push.
Derivatives by delta_a are central differences of whole contact states: they know how contact changes the robot's
stiffness, the curvature of obstacles included. They are of one side where a patch begins to touch or slide."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.contact.course import Course, stops
from cfem.contact.obstacle import Obstacle
from cfem.contact.problem import Law
from cfem.contact.several import Several
from cfem.core.errors import NumericalError
from cfem.predict.clearance import clearance
from cfem.predict.touchable import Touchable
from cfem.predict.touching import Touched, touch_step

STEP = 1e-4  # of the reach: of the differences
LONGEST = 0.005  # of the length: the longest way of an obstacle in one quasi-static step
SHARE = 0.05  # of its reach: the longest way of an actuator in one quasi-static step under friction


@dataclass
class Among:
    """`Model`. solid: obstacles that the robot may touch, by name; pressed: those of them whose force is a row, in
    their order; avoided: obstacles whose distance is a row. It remembers the contact state `before` in which the robot
    stands, actuators `at` (n_a,) mm (`settle`): there a step begins, as friction and the side of an edge depend on the
    way. courses: of obstacles that move, by name; share: of the run, where they are now (`pass_to`)."""

    touchable: Touchable
    solid: Mapping[str, Obstacle]
    pressed: tuple[str, ...] = ()
    avoided: Mapping[str, Obstacle] = field(default_factory=dict)
    law: Law = "coulomb"
    mu: float = 0.0
    before: Touched | None = None
    at: np.ndarray | None = None
    courses: Mapping[str, Course] = field(default_factory=dict)
    share: float = 0.0

    @cached_property
    def rows(self) -> Rows:
        own = self.touchable.model.rows
        more = (*(f"{name}.force" for name in self.pressed), *(f"{name}.distance" for name in self.avoided))
        return Rows((*own.effectors, *more), own.actuators)

    @cached_property
    def stiffnesses(self) -> np.ndarray:
        """(N,) N/mm: of each patch to a force on it, of any direction; infinite where the body is held."""
        mean = np.diagonal(self.touchable.by_fe.own, axis1=1, axis2=2).mean(axis=0).reshape(-1, 3).mean(axis=1)
        return 1.0 / np.maximum(mean, 1e-12 * mean.max())

    @cached_property
    def _around(self) -> Several:
        return Several(tuple(self.solid.values()))

    @property
    def kinked(self) -> bool:
        """Whether friction may hold the robot, so that answers lie on either side of where it does."""
        return self.mu > 0 and bool(self.solid)

    @property
    def stiffness(self) -> float:
        """N/mm: that of the patches, the median."""
        return float(np.median(self.stiffnesses))

    def touched(self, delta_a: np.ndarray) -> Touched | None:
        """The contact state at delta_a (n_a,) mm, None without anything solid. NumericalError where there is none."""
        return self._step(delta_a, self._way(delta_a))

    def _way(self, delta_a: np.ndarray) -> Touched | None:
        """The state in which the last step to delta_a (n_a,) mm begins: with friction the way is gone in steps."""
        state, begin = self.before, np.zeros(len(delta_a)) if self.at is None else self.at
        if self.mu > 0 and self.solid:
            if state is None:
                state = self._step(begin, None)
            longest = SHARE * np.abs(self.touchable.model.reach).max(axis=1)
            count = int(np.ceil((np.abs(delta_a - begin) / longest).max()))
            for step in range(1, count):
                state = self._step(begin + step / count * (delta_a - begin), state)
        return state

    def _step(self, delta_a: np.ndarray, before: Touched | None) -> Touched | None:
        if not self.solid:
            return None
        found = touch_step(self.touchable, delta_a, self._around, self.law, self.mu, before)
        if not found.converged:
            raise NumericalError(f"learned contact: {found.status.value}")
        return found

    def settle(self, delta_a: np.ndarray) -> None:
        """The robot stands at delta_a (n_a,) mm now: further steps begin there."""
        delta_a = np.asarray(delta_a, float)
        self.before, self.at = self.touched(delta_a), delta_a

    def pass_to(self, share: float) -> None:
        """Obstacles that move go to where they are at this share of the run, the robot giving way with its actuators
        held. NumericalError where there is no contact state: then they stay where there was one."""
        longest = LONGEST * self.touchable.model.length
        for begin, end in stops(self.courses.values(), self.share, share, longest):
            last = self.solid, self.avoided
            self._stand(end)
            try:
                if self.at is not None and self.solid:
                    state = self.before if self.before is None or not self.mu else self._carried(begin, end)
                    self.before = self._step(self.at, state)
            except NumericalError:
                (self.solid, self.avoided), _ = last, self.__dict__.pop("_around", None)
                raise
            self.share = end

    def standing(self, share: float) -> "Among":
        """A robot at rest, that has touched nothing yet, with obstacles where they are at this share of the run."""
        found = replace(self, before=None, at=None, share=share)
        found._stand(share)
        return found

    def _stand(self, share: float) -> None:
        now = {name: one.at(share) for name, one in self.courses.items()}
        self.solid = {name: now.get(name, one) for name, one in self.solid.items()}
        self.avoided = {name: now.get(name, one) for name, one in self.avoided.items()}
        self.__dict__.pop("_around", None)

    def _carried(self, begin: float, end: float) -> Touched:
        """The last state, what touches carried along by what it touches."""
        stuck = self.before.stuck.copy()
        for number, name in enumerate(self.solid):
            mine = self.before.patches[(self.before.obstacles == number) & self.before.forces.any(axis=1)]
            if name in self.courses and len(mine):
                stuck[mine] = self.courses[name].carried(stuck[mine], begin, end)
        return replace(self.before, stuck=stuck)

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        """NumericalError where there is no contact state."""
        delta_a = np.asarray(delta_a, float)
        before = self._way(delta_a)
        here = self._step(delta_a, before)
        near = here
        if before is not None:  # friction counts from there, forces are like those here
            near = replace(here, stuck=before.stuck, everywhere=before.everywhere)
        e, lam = self._values(delta_a, here)
        n_a = len(delta_a)
        J, K = np.zeros((len(e), n_a)), np.zeros((n_a, n_a))
        for axis, reach in enumerate(self.touchable.model.reach):
            step = STEP * np.abs(reach).max() * np.eye(n_a)[axis]
            ahead, behind = (self._values(one, self._step(one, near)) for one in (delta_a + step, delta_a - step))
            J[:, axis], K[:, axis] = ((a - b) / (2 * step[axis]) for a, b in zip(ahead, behind, strict=True))
        for one in self.avoided.values():
            apart = clearance(self.touchable.model, delta_a, one)
            e, J = np.append(e, apart.distance), np.vstack([J, apart.gradient])
        rows, W_aa = self.rows, np.linalg.inv((K + K.T) / 2)
        W, W_ea = np.empty((rows.n, rows.n)), J @ W_aa
        W[rows.e, rows.e], W[rows.e, rows.a], W[rows.a, rows.e], W[rows.a, rows.a] = W_ea @ J.T, W_ea, W_ea.T, W_aa
        delta = np.concatenate([e, delta_a])
        return Condensed(rows, W, delta - W[:, rows.a] @ lam, lam)

    def inside(self, condensed: Condensed) -> bool:
        return self.touchable.model.inside(condensed)

    def distance(self, condensed: Condensed) -> float:
        return self.touchable.model.distance(condensed)

    def _values(self, delta_a: np.ndarray, touched: Touched | None) -> tuple[np.ndarray, np.ndarray]:
        """Effectors and forces on what is pressed, (n_a,) N of the actuators."""
        if touched is None:
            free = self.touchable.model.at_displacement(delta_a)
            return free.delta_e, free.lambda_a
        forces = touched.pressed(len(self.solid))
        pressed = np.array([forces[number] for number, name in enumerate(self.solid) if name in self.pressed])
        missing = [number for number, name in enumerate(self.pressed) if not pressed[number]]
        if missing:
            for number in missing:
                gaps = np.maximum(self.solid[self.pressed[number]].distance(touched.everywhere), 0.0)
                pressed[number] = -(self.stiffnesses * gaps).min()
        return np.concatenate([touched.delta_e, pressed]), touched.lambda_a
