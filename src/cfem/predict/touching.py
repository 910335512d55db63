"""A learned robot that touches anything with any part of its surface, at actuators that are held.

Signed distances and frames of obstacles at the patches' places, and the compliance of all patches that touch
(`cfem.predict.touchable`), make one linear contact problem (`cfem.contact`), which is solved exactly. It is posed again
where the patches have come to, until neither forces nor the patches that touch change. The forces of the actuators
follow from the energy of the loaded robot, Psi - w . s_0 - w . C_ss w / 2 (`cfem.predict.loaded`).

A step begins where the last one ended: on which side of an edge a patch has come to lie, and where friction holds it,
depends on the way."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from cfem.contact.modes import Mode
from cfem.contact.obstacle import Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.patch_forces import pressed, turned, violation
from cfem.contact.problem import Law, demand_friction
from cfem.predict.held import Held
from cfem.predict.slack import with_slack
from cfem.predict.touchable import Touchable

ITERATIONS = 60
TOLERANCE = 1e-9  # of the length: how far gaps, and places by their forces, may be from what the law says
MOST = 30  # patches that may touch at once
TRUSTED = 0.3  # second order of the motion over the first: beyond it forces are wrong (docs/contact.md)
SIDE = 0.7  # product of normals: less is another side of an obstacle
OVERLAP = 1e-6  # of the length: how far a patch may be within an obstacle
FAR = 0.1  # of the length: no distance is larger, as none is asked
NEAR = 0.005  # of the length: farther patches that bear nothing are forgotten between steps


class TouchedStatus(Enum):
    """How it ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    NO_MODE = "no combination of open, sticking and sliding patches is in equilibrium"
    ITERATIONS = "open, sticking and sliding patches keep changing: the iterations allowed were used up"
    MANY = f"more than {MOST} patches touch: take larger patches"


@dataclass(frozen=True)
class Touched:
    """One state. patches (c,): numbers of those that touch; forces (c, 3) N on them, normals (c, 3) of what they touch
    and places (c, 3) mm; everywhere (N, 3) mm: places of all patches; gaps (c,) mm; obstacles (c,): numbers of those
    that they touch; modes: of each patch; delta_e (n_e,) mm of the touched robot, at delta_a (n_a,) mm under lambda_a
    (n_a,) N, negative where a cable that is held would have to push; rows (k,) mm of the skin, from which
    `LearnedSkin.surface` draws it (without what is local); stuck (N, 3) mm where friction holds each patch, NaN where
    it does not; near (d,): numbers of these patches and of those that may touch next; bending: the second order of the
    motion over its first, the largest of all rounds; deep: whether a patch began so far within an obstacle that,
    twice as far in, another side of it is nearer (`known`)."""

    status: TouchedStatus
    patches: np.ndarray
    forces: np.ndarray
    normals: np.ndarray
    places: np.ndarray
    everywhere: np.ndarray
    gaps: np.ndarray
    obstacles: np.ndarray
    modes: tuple[Mode, ...]
    delta_e: np.ndarray
    delta_a: np.ndarray
    lambda_a: np.ndarray
    rows: np.ndarray
    stuck: np.ndarray
    near: np.ndarray
    bending: float
    deep: bool
    iterations: int

    @property
    def converged(self) -> bool:
        return self.status is TouchedStatus.CONVERGED

    @property
    def known(self) -> bool:
        """Whether the step was no longer than what it is linear about allows. Beyond, forces may be wrong, a patch may
        lie on another side than the one on which it came in, and rounding may choose between states that all obey the
        law: take shorter steps."""
        return self.bending <= TRUSTED and not self.deep

    @property
    def pull(self) -> np.ndarray:
        """(n_a,) N of the actuators."""
        return self.lambda_a

    def pressed(self, count: int) -> np.ndarray:
        """(count,) N: how hard each obstacle is pressed, the sum of its normal forces."""
        return np.bincount(self.obstacles, (self.forces * self.normals).sum(axis=1), count).astype(float)


def touch_step(
    touchable: Touchable,
    delta_a: np.ndarray,
    obstacles: Sequence[Obstacle] | ObstacleSet,
    law: Law = "coulomb",
    mu: float = 0.0,
    before: Touched | None = None,
    unilateral: np.ndarray | None = None,
) -> Touched:
    """Quasi-static step to delta_a (n_a,) mm from the state `before` (none: the free robot, from where patches
    slide). Obstacles stand in the frame of the robot; mu: of friction, of all; unilateral (n_a,) bool: actuators that
    go slack where they would push (`cfem.predict.slack`), the others are held. Never raises for numerical failure.
    SpecError where mu is no coefficient of friction."""
    demand_friction(mu)
    target, around = np.asarray(delta_a, float), ObstacleSet.of(obstacles)

    def held(at: np.ndarray) -> Touched:
        step, status = _Step(Held(touchable, at), around, mu if law == "coulomb" else 0.0, before), None
        while status is None:
            status = step.round() if step.iterations < ITERATIONS else TouchedStatus.ITERATIONS
        return step.result(status)

    if unilateral is None or not unilateral.any():
        return held(target)
    known = None if before is None else (before.delta_a, before.lambda_a)
    found, slack, settled = with_slack(held, [touchable.model], unilateral, target, known)
    status = found.status if settled else TouchedStatus.ITERATIONS
    return replace(found, status=status, lambda_a=np.where(slack, 0.0, found.lambda_a))


class _Step:
    """Rounds of one step. Of all patches: places (N, 3) mm, distance (N,) mm, or less where that is far above 0, and
    which (N,) obstacle; stuck (N, 3) mm from where they slide. chosen (c,): those that may
    touch, with forces (c, 3) N and modes."""

    def __init__(self, held: Held, around: ObstacleSet, mu: float, before: Touched | None):
        self.held, self.around, self.mu, self.iterations = held, around, mu, 0
        self.length = held.of.model.length
        self.stuck = held.free.copy()  # what did not touch slides from where it was
        self.modes: tuple[Mode, ...] = ()
        self._sticks = np.zeros(len(held.free), dtype=bool)  # in the last round
        self._into: np.ndarray | None = None  # frames at the places, where they are known
        if before is not None:
            self._bear(before.near, before.patches, before.forces)
            if mu:
                self.stuck = np.where(np.isnan(before.stuck), before.everywhere, before.stuck)
                self._sticks[before.patches] = [mode is Mode.STICK for mode in before.modes]
        self.places = held.places()
        self.distance, self.which = around.nearest(self.places, FAR * self.length)
        self.distance[held.of.held_still] = np.inf
        self.deep = self._deep()

    @property
    def chosen(self) -> np.ndarray:
        return self.held.chosen

    @property
    def forces(self) -> np.ndarray:
        return self.held.forces

    def _bear(self, chosen: np.ndarray, patches: np.ndarray, forces: np.ndarray) -> None:
        """Forces (c, 3) N on patches (c,), among the chosen ones."""
        everywhere = np.zeros_like(self.held.free)
        everywhere[patches] = forces
        self.held.bear(chosen, everywhere[chosen])

    def round(self) -> TouchedStatus | None:
        """None: another one is needed."""
        self.iterations += 1
        touching = self.distance <= 0
        touching[self.chosen] = True  # also those that have opened: only of the chosen are places quite known
        chosen, self.modes = np.flatnonzero(touching), ()
        if not 0 < len(chosen) <= MOST:
            self.held.bear(chosen[:0], self.forces[:0])
            return TouchedStatus.MANY if len(chosen) else TouchedStatus.CONVERGED
        if len(chosen) > len(self.chosen):
            self._bear(chosen, self.chosen, self.forces)
            self.places, self._into = self.held.places(), None  # moved by those beside them
            self.distance[chosen], self.which[chosen] = self.around.nearest(self.places[chosen])
        into = self.around.frames(self.which[chosen], self.places[chosen]) if self._into is None else self._into
        found = self._law(self.held.compliance(), into)
        if found is None:
            return TouchedStatus.NO_MODE
        return TouchedStatus.CONVERGED if self._moved(*found) else None

    def _law(self, yields: np.ndarray, into: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Forces by the law of contact, linear about the chosen patches' places, where `into` (c, 3, 3) are the frames:
        in these frames, and turned with curved obstacles, each (c, 3) N. None where nothing obeys the law."""
        known, gap, softer = (into @ self.forces[:, :, None])[:, :, 0], self._gaps(into), None
        if self.around.curved:
            turns, chosen = np.where(self._sticks[self.chosen], 0.0, known[:, 0]), self.chosen
            bends = turns[:, None, None] * self.around.bends(self.which[chosen], self.places[chosen])
            softer = turned(yields, bends) if turns.any() else None
        answer = None if softer is None else pressed(softer[0], gap, into, known, self.mu)
        if answer is None:
            softer, answer = None, pressed(yields, gap, into, known, self.mu)
        if answer is None:  # under large forces the derivative may be indefinite, which this is not
            answer = pressed(self.held.unpressed(self.chosen), gap, into, known, self.mu)
        if answer is None:
            return None
        self.modes, local = answer
        forces = (local[:, None] @ into)[:, 0]
        if softer is not None:
            forces += (softer[1] @ (forces - self.forces).ravel()).reshape(-1, 3)
        return local, forces

    def _gaps(self, into: np.ndarray) -> np.ndarray:
        """(c, 3) mm of the chosen patches, in the frames `into` (c, 3, 3): from what they meet, and from where they
        last stuck."""
        found = np.zeros((len(into), 3))
        if self.mu:
            found = (into @ (self.places - self.stuck)[self.chosen, :, None])[:, :, 0]
        found[:, 0] = self.distance[self.chosen]
        return found

    def _moved(self, local: np.ndarray, forces: np.ndarray) -> bool:
        """To where `forces` bring the patches. True where the law holds there too, with the frames there, in
        which the forces are then."""
        chosen, mu, held = self.chosen, self.mu, self.held
        sticks = self._stick() if mu else np.zeros(0, dtype=np.int64)
        self._sticks[:] = False
        self._sticks[chosen[sticks]] = True
        held.bear(chosen, forces)
        before, self.places = self.places, held.places()
        self._look(np.abs(self.places - before).max())
        self._into = into = self.around.frames(self.which[chosen], self.places[chosen])
        there, yields = (local[:, None] @ into)[:, 0], held.unpressed(chosen)
        there[sticks], local[sticks] = forces[sticks], (into[sticks] @ forces[sticks, :, None])[:, :, 0]
        off = max(np.abs(yields @ (there - forces).ravel()).max(), violation(local, self._gaps(into), yields, mu))
        if off > TOLERANCE * self.length or self.distance.min() < -OVERLAP * self.length:
            return False
        beyond = np.hypot(local[:, 1], local[:, 2]) - mu * local[:, 0]
        if beyond.max() > TOLERANCE * np.abs(forces).max():
            return False
        if not np.array_equal(there, forces):
            held.bear(chosen, there)
        return True

    def _stick(self) -> np.ndarray:
        """Which of the chosen patches stick."""
        return np.array([i for i, mode in enumerate(self.modes) if mode is Mode.STICK], dtype=np.int64)

    def _look(self, farthest: float) -> None:
        """How far the patches are, none of which has moved by more than `farthest` mm along an axis: those that cannot
        have come near keep what is certain."""
        self.distance = self.distance - 2 * farthest  # more than the root of 3
        near = self.distance <= 0
        near[self.chosen] = True
        self.distance[near], self.which[near] = self.around.nearest(self.places[near])

    def _deep(self) -> bool:
        """`Touched.deep`."""
        within = self.distance < 0
        if not within.any():
            return False
        which, places = self.which[within], self.places[within]
        normals = self.around.frames(which, places)[:, 0]
        deeper = self.around.frames(which, places + self.distance[within, None] * normals)[:, 0]
        return bool(((normals * deeper).sum(axis=1) < SIDE).any())

    def _settle(self) -> None:
        """Where friction holds patches from here on."""
        holds = np.full_like(self.stuck, np.nan)
        if self.mu and self.modes:
            bears, stay = self.chosen[self.forces.any(axis=1)], self._stick()
            holds[bears] = self.places[bears]
            if len(stay):  # where they were, on the surface
                last, normals = self.stuck[self.chosen[stay]], self._into[stay, 0]
                away = ((self.places[self.chosen[stay]] - last) * normals).sum(axis=1)
                holds[self.chosen[stay]] = last + away[:, None] * normals
        self.stuck = holds

    def result(self, status: TouchedStatus) -> Touched:
        self._settle()
        held, near = self.held, self.chosen
        bears = self.forces.any(axis=1)
        meets = bears | (self.distance[near] <= 0)
        chosen = near[meets]
        normals = (self.around.frames(self.which[near], self.places[near]) if self._into is None else self._into)[:, 0]
        base = held.of.model.at_displacement(held.delta)
        return Touched(
            status,
            chosen,
            self.forces[meets],
            normals[meets],
            self.places[chosen],
            self.places,
            self.distance[chosen],
            self.which[chosen],
            tuple(mode for mode, one in zip(self.modes, meets, strict=False) if one),
            base.delta_e + (held.tip() if bears.any() else 0.0),
            held.delta,
            base.lambda_a - (held.relief() if bears.any() else 0.0),
            held.rows,
            self.stuck,
            near[meets | (self.distance[near] < NEAR * self.length)],
            held.bending,
            self.deep,
            self.iterations,
        )
