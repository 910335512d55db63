"""A learned robot among obstacles and other robots, as a model that control plans with: contact is part of its answer.

Its rows are the effectors', and behind them, for each that is to be pressed, the force on it, and for each that is to
be avoided, the distance from it:

    <name>.force     N, the sum of normal forces; where nothing touches, minus what a patch needs to go so far
    <name>.distance  mm, of the whole surface (`cfem.predict.contact.clearance`)

so that a goal of force is a goal of a row, and a distance to be kept a bound of a row. What is avoided does not push.
Derivatives by delta_a are central differences of whole contact states: they know how contact changes the robot's
stiffness, the curvature of obstacles included. They are of one side where a patch begins to touch or slide, and where
no contact state is found on the other."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.condensed.model_error import ContactError, StateError
from cfem.contact.law.sliding import PARTS
from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import numbers_of
from cfem.contact.prescribed_motion import ActuatedRobot, PrescribedMotion, stops
from cfem.core.errors import NumericalError
from cfem.equilibrium.quasi_static import CONVERGED, carried_out
from cfem.predict.contact.clearance import clearance
from cfem.predict.contact.error import ContactBounds, contact_error
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import SHARE, ContactScene
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.surface_model import SurfaceModel

STEP = 1e-4  # of the reach: of the differences
LONGEST = 0.005  # of the length: the longest way of an obstacle in one quasi-static step
HALVINGS = 6  # of a step in which a patch begins too deep, or forces hardly settle

Step = Callable[[Any, Any, ContactState | None], ContactState]  # from where, to where, and the state there


@dataclass(frozen=True)
class InContact(Condensed):
    """Condensed robot in contact. trusted: as `ContactState` has it. bounds: of what contact adds to the model's error,
    None where nobody has stated any."""

    trusted: bool
    bounds: ContactBounds | None = None


def _long(state: ContactState) -> bool:
    """True where the step to a state was longer than can be trusted, or one before it."""
    return state.deep or state.unsettled


@dataclass
class ContactModel:
    """`Model` of a robot among others. It remembers the contact state in which the robot stands: there a step begins,
    as friction and the side of an edge depend on the path.

    solid: rigid obstacles that the robot may touch, by name
    pressed: names of those, of `others` and of `itself` whose force is a row, in their order
    avoided: obstacles whose distance is a row
    mu: coefficient of friction
    before, at: contact state in which the robot stands, and its actuators (n_a,) mm (`settle`)
    courses: motions of obstacles, by name
    share: of the run, where moving things are now (`pass_to`)
    others: robots that it may touch, by name, each placed and with the course of its actuators
    itself: the name under which it touches itself, or none
    unilateral: (n_a,) bool, actuators that go slack at `pass_to` where they would push; plans hold them
    stated: error of the contact of this robot's model, and then of those of `others`; none where nobody has calibrated
        them
    step: share of its reach that an actuator goes in one step, where the answer depends on the way
    parts: in which friction is followed along a step"""

    patched: SurfaceModel
    solid: Mapping[str, Obstacle]
    pressed: tuple[str, ...] = ()
    avoided: Mapping[str, Obstacle] = field(default_factory=dict)
    mu: float = 0.0
    before: ContactState | None = None
    at: np.ndarray | None = None
    courses: Mapping[str, PrescribedMotion] = field(default_factory=dict)
    share: float = 0.0
    others: Mapping[str, tuple[PlacedModel, ActuatedRobot]] = field(default_factory=dict)
    itself: tuple[str, ...] = ()
    unilateral: np.ndarray | None = None
    stated: tuple[ContactError, ...] = ()
    step: float = SHARE
    parts: int = PARTS

    @cached_property
    def rows(self) -> Rows:
        robot_rows = self.patched.model.rows
        more = (*(f"{name}.force" for name in self.pressed), *(f"{name}.distance" for name in self.avoided))
        return Rows((*robot_rows.effectors, *more), robot_rows.actuators)

    @cached_property
    def stiffness(self) -> float:
        """N/mm: of the patches to forces of any direction, the median."""
        mean = self.patched.flexibility.mean(axis=1)
        return float(np.median(1.0 / np.maximum(mean, 1e-12 * mean.max())))

    @cached_property
    def numbers(self) -> dict[str, int]:
        return numbers_of(self.itself, self.others, self.solid)

    @property
    def touches(self) -> bool:
        """True where there is anything that it may touch."""
        return bool(self.numbers)

    @property
    def passes(self) -> bool:
        """True where anything that it meets or avoids moves."""
        return bool(self.courses or self.others)

    @cached_property
    def scene(self) -> ContactScene:
        robots = [
            PlacedModel(self.patched, itself=bool(self.itself)),
            *(placed for placed, _ in self.others.values()),
        ]
        return ContactScene(robots, ObstacleSet(tuple(self.solid.values())), self.mu, parts=self.parts)

    @property
    def depends_on_way(self) -> bool:
        """True where the path between two states is followed in steps."""
        return self.mu > 0 or self.scene.soft

    @property
    def kinked(self) -> bool:
        """True where friction may hold the robot, so that answers lie on either side of where it does."""
        return self.mu > 0 and self.touches

    def touched(self, delta_a: np.ndarray) -> ContactState | None:
        """The contact state at delta_a (n_a,) mm, None where it touches nothing. NumericalError where there is none."""
        return self._walked(np.asarray(delta_a, float))[1]

    def _walked(self, delta_a: np.ndarray) -> tuple[ContactState | None, ContactState | None]:
        """States in which the last step to delta_a (n_a,) mm begins and ends."""
        if not self.touches:
            return None, None
        begin = np.zeros(len(delta_a)) if self.before is None else self.before.deltas[0]
        if not self.depends_on_way:
            return self.before, self._in_halves(self._stepped_from, begin, delta_a, self.before)
        states = [self._step(begin, None)] if self.before is None else [self.before]

        def go(target: np.ndarray) -> str:
            state = self._stepped(target, states[-1])
            if state.converged:
                states.append(state)
            return CONVERGED if state.converged else state.status.value

        status = carried_out(begin, delta_a, self.step * np.abs(self.patched.model.reach).max(axis=1), go)
        if status != CONVERGED:
            raise NumericalError(f"learned contact: {status}")
        return states[-2], states[-1]

    def _stepped_from(self, _: np.ndarray, delta_a: np.ndarray, before: ContactState | None) -> ContactState:
        return self._step(delta_a, before)

    def _in_halves(
        self, go: Step, begin: Any, end: Any, before: ContactState | None, times: int = HALVINGS
    ) -> ContactState:
        """The state at the end of a step; in halves, which are halved `times` at most, where a patch begins deeper in
        an obstacle than can be trusted, or forces hardly settle."""
        state = go(begin, end, before)
        if not times or not _long(state) or (before is not None and _long(before)):
            return state
        middle = (begin + end) / 2
        return self._in_halves(go, middle, end, self._in_halves(go, begin, middle, before, times - 1), times - 1)

    def _stepped(
        self, delta_a: np.ndarray, before: ContactState | None, unilateral: np.ndarray | None = None
    ) -> ContactState:
        deltas = [delta_a, *(course.deltas(self.share) for _, course in self.others.values())]
        if before is None and self.scene.soft:
            return self.scene.start(deltas)
        return self.scene.step(deltas, before, unilateral)

    def _step(
        self, delta_a: np.ndarray, before: ContactState | None, unilateral: np.ndarray | None = None
    ) -> ContactState | None:
        """NumericalError where there is no state."""
        if not self.touches:
            return None
        state = self._stepped(delta_a, before, unilateral)
        if not state.converged:
            raise NumericalError(f"learned contact: {state.status.value}")
        return state

    def settle(self, delta_a: np.ndarray) -> None:
        """The robot stands at delta_a (n_a,) mm now: further steps begin there."""
        delta_a = np.asarray(delta_a, float)
        self.before, self.at = self.touched(delta_a), delta_a

    def pass_to(self, share: float) -> None:
        """Moves everything that moves to where it is at this share of the run, the robot giving way with its actuators
        held, or slack. NumericalError where there is no contact state: then it stays where there was one."""
        longest, others = LONGEST * self.patched.model.length, [course for _, course in self.others.values()]
        for begin, end in stops([*self.courses.values(), *others], self.share, share, longest):
            if self.at is None or not self.touches:
                self._stand(end)
            else:
                self._in_halves(self._carried, begin, end, self.before)

    def _carried(self, begin: float, end: float, before: ContactState | None) -> ContactState:
        """The state after everything that moves has gone from one share of the run to another."""
        courses = {self.numbers[name]: course for name, course in self.courses.items() if name in self.numbers}
        self._stand(end)
        try:
            self.before = self._step(self.at, before and before.carried(courses, begin, end), self.unilateral)
        except NumericalError:
            self._stand(begin)
            self.before = before
            raise
        return self.before

    def standing(self, share: float) -> "ContactModel":
        """A robot at rest, that has touched nothing yet, with what moves where it is at this share of the run."""
        model = replace(self, before=None, at=None)
        model._stand(share)
        return model

    def _stand(self, share: float) -> None:
        now = {name: thing.at(share) for name, thing in self.courses.items()}
        self.solid = {name: now.get(name, thing) for name, thing in self.solid.items()}
        self.avoided = {name: now.get(name, thing) for name, thing in self.avoided.items()}
        self.share = share
        self.__dict__.pop("scene", None)

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        """The condensed robot in contact at delta_a (n_a,) mm. NumericalError where there is no contact state."""
        delta_a = np.asarray(delta_a, float)
        before, state = self._walked(delta_a)
        near = state if before is None else state.slipping_from(before)
        e, lam = self._values(delta_a, state)
        n_a = len(delta_a)
        J, K = np.zeros((len(e), n_a)), np.zeros((n_a, n_a))
        for axis, reach in enumerate(self.patched.model.reach):
            step = STEP * np.abs(reach).max() * np.eye(n_a)[axis]
            (ahead, behind), width = self._sides(delta_a, step, near, (e, lam))
            J[:, axis], K[:, axis] = ((a - b) / (width * step[axis]) for a, b in zip(ahead, behind, strict=True))
        for obstacle in self.avoided.values():
            apart = clearance(self.patched.model, delta_a, obstacle)
            e, J = np.append(e, apart.distance), np.vstack([J, apart.gradient])
        rows, W_aa = self.rows, np.linalg.inv((K + K.T) / 2)
        W, W_ea = np.empty((rows.n, rows.n)), J @ W_aa
        W[rows.e, rows.e], W[rows.e, rows.a], W[rows.a, rows.e], W[rows.a, rows.a] = W_ea @ J.T, W_ea, W_ea.T, W_aa
        delta = np.concatenate([e, delta_a])
        trusted = state is None or state.trusted
        return InContact(rows, W, delta - W[:, rows.a] @ lam, lam, trusted, self._bounds(state))

    def _bounds(self, state: ContactState | None) -> ContactBounds | None:
        if state is None or not self.stated:
            return None
        return contact_error(self.stated, self.scene, state)

    def error(self, condensed: Condensed) -> StateError | None:
        """Bound of the tip's error at a state found with the model, of the robot alone and by contact; of nothing else.
        None where the error of the contact is not known."""
        bounds = getattr(condensed, "bounds", None)
        if bounds is None:
            return None
        alone = self.patched.model.error(condensed)
        tip = np.array(bounds.tip) + (0.0 if alone is None else alone.tip)
        rows = condensed.rows
        probability = min(robot.probability for robot in self.stated)
        return StateError(probability, tip, np.full(rows.n_a, np.nan), np.full((rows.n, rows.n), np.nan))

    def _sides(
        self, delta_a: np.ndarray, step: np.ndarray, near: ContactState, middle: tuple[np.ndarray, np.ndarray]
    ) -> tuple[list[tuple[np.ndarray, np.ndarray]], int]:
        """Values of `_values` ahead and behind, and the number of steps between them: `middle` in the place of a side
        that has no contact state. NumericalError where neither has one."""
        sides, width = [middle, middle], 0
        failed: NumericalError | None = None
        for side, sign in enumerate((1, -1)):
            try:
                target = delta_a + sign * step
                sides[side] = self._values(target, self._step(target, near))
                width += 1
            except NumericalError as error:
                failed = error
        if not width and failed is not None:
            raise failed
        return sides, width

    def inside(self, condensed: Condensed) -> bool:
        """True where the model knows the state, and its contact is trusted."""
        return getattr(condensed, "trusted", True) and self.patched.model.inside(condensed)

    def distance(self, condensed: Condensed) -> float:
        return self.patched.model.distance(condensed)

    def _values(self, delta_a: np.ndarray, touched: ContactState | None) -> tuple[np.ndarray, np.ndarray]:
        """Effectors and forces on what is pressed, (n_a,) N of the actuators."""
        if touched is None:
            free = self.patched.model.at_displacement(delta_a)
            return free.delta_e, free.lambda_a
        forces = np.array([self.scene.force_or_gap(touched, self.numbers[name]) for name in self.pressed])
        forces = np.where(forces < 0, self.stiffness, 1.0) * forces
        return np.concatenate([touched.delta_e[0], forces]), touched.lambda_a[0]
