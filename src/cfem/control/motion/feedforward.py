"""Controllers that turn what lies ahead into commands of the static controller: shaped, or with what inertia and
viscosity ask for on top (computed feed-forward)."""

from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Belief, MovingBelief, Pilot, drive
from cfem.control.motion.shaping import Kind, Shaper, shaper
from cfem.motion.model import MotionModel, MotionTerms
from cfem.motion.modes import natural_modes
from cfem.plant.protocol import Measurement

_LATE = 3  # ticks that a goal takes through the stages of the computed feed-forward


class Shaped:
    """The static controller behind a shaper for the robot's modes where it now stands. Goals are shaped, those of a
    closed loop before they are corrected, and taken from ahead as far as they are known.

    belief, aimed, feedback: of the static controller, and `shaper`: the present one"""

    def __init__(self, controller: Controller, model: MotionModel, held: bool, kind: Kind, modes: int, dt: float):
        """held: whether displacements are commanded; modes: how many are shaped; dt: s of a tick."""
        self._controller, self._model, self._held = controller, model, held
        self._kind, self._modes, self._dt = kind, modes, dt
        self._past: deque[np.ndarray] = deque(maxlen=int(10.0 / dt))
        self.shaper: Shaper | None = None
        self.belief, self.aimed, self.feedback = controller.belief, controller.aimed, controller.feedback

    def tick(self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None) -> Any:
        """Belief of the static controller after a tick; ahead (k, n_e): goals at the ends of this tick and the next
        ones."""
        goals = np.atleast_2d(np.asarray(goal if ahead is None else ahead, float))
        delta_a = self._controller.belief.iterate.condensed.delta_a
        modes = natural_modes(self._model, delta_a, self._held, self._modes)
        self.shaper = shaper(self._kind, modes.frequency, np.minimum(modes.damping, 0.9))
        weights, later = self.shaper.ticks(self._dt)
        if len(goals) == 1:  # nothing is known ahead: the shaped goal comes late
            later = 0
        if not self._past:
            self._past.extend([goals[0]] * len(weights))
        # weights[i] is of the goal i - later ticks ago
        ago = np.arange(len(weights)) - later
        before = self._past[0]
        known = [
            goals[min(-k, len(goals) - 1)] if k <= 0 else (self._past[-k] if k <= len(self._past) else before)
            for k in ago
        ]
        self._past.append(goals[0])
        self.belief = self._controller.tick(weights @ np.array(known), measured)
        self.aimed = self._controller.aimed
        return self.belief


class Computed:
    """Computed feed-forward along the goals that lie ahead, without sensors: the static inverse of goals from which the
    inner motions are taken off that the acceleration of the actuators will excite, and, where forces are commanded, the
    forces of inertia and viscosity on top:

        eta = -K^-1 (M_ra a + F_ra v)        u = dPsi/d delta_a + (M [a; d2eta/dt2] + F [v; deta/dt])_a

    with v and a from differences of the actuators' static plan. The inner motions are taken to follow without
    vibrations of their own, which holds well below the frequencies of the robot with its actuators held.

    Twice, as the first answer moves the goals that the second is of. Each goal passes through the same stages, three
    ticks before its time."""

    def __init__(self, pilot: Pilot, model: MotionModel, rest_e: np.ndarray, start: np.ndarray, dt: float):
        """start: (n_a,) mm where the robot stands."""
        self._pilot, self._model, self._rest_e, self._dt = pilot, model, rest_e, dt
        self._search = replace(pilot, command="displacement", rate=np.inf)
        first = Belief.at(self._search, start)
        self._place = [first, first]
        condensed = first.iterate.condensed
        self.belief = MovingBelief(
            condensed.lambda_a if pilot.command == "force" else condensed.delta_a, "converged", condensed.delta_a
        )
        self.aimed = rest_e + condensed.delta_e
        none = np.zeros(model.n_r)
        self._goals, self._planned = _three(condensed.delta_e), [_three(condensed.delta_a), _three(condensed.delta_a)]
        self._inner, self._forces = _three(none), _three(condensed.lambda_a)
        self._behind = True

    def tick(
        self, goal: ArrayLike, measured: Measurement | None = None, ahead: ArrayLike | None = None
    ) -> MovingBelief:
        """Belief after a tick; ahead (k, n_e): goals at the ends of this tick and the next ones."""
        goals = np.atleast_2d(np.asarray(goal if ahead is None else ahead, float))
        for k in range(0 if self._behind else _LATE, _LATE + 1):
            u = self._next(goals[min(k, len(goals) - 1)] - self._rest_e)
        self._behind, self.aimed = False, goals[0]
        limits, last = self._pilot.limits, self.belief.u
        u = np.clip(u, *(limits.lambda_a if self._pilot.command == "force" else limits.delta_a).T)
        u = np.clip(u, last - self._pilot.rate, last + self._pilot.rate)
        self.belief = MovingBelief(u, "converged", self._planned[1][0])
        return self.belief

    def _next(self, goal: np.ndarray) -> np.ndarray:
        """Command (n_a,) of three ticks ago, of a goal (n_e,) mm from rest; each queue is a tick behind the one before
        it."""
        self._goals.append(goal)
        self._planned[0].append(self._static(0, goal))
        eta, _ = self._excited(self._planned[0])
        place = self._model.at(self._planned[0][1])
        self._planned[1].append(self._static(1, self._goals[1] - (place.effectors(eta) - place.e)))
        eta, forces = self._excited(self._planned[1])
        self._inner.append(eta)
        self._forces.append(forces)
        if self._pilot.command == "displacement":
            return self._planned[1][0]
        v, a = _rates(self._inner, self._dt)
        place, n_a = self._model.at(self._planned[1][0]), self._model.n_a
        return self._forces[1] + place.M[:n_a, n_a:] @ a + self._lost(place)[:n_a, n_a:] @ v

    def _excited(self, planned: deque[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Inner motions (n_r,) and the actuators' forces (n_a,), without those of the inner motions' own rates, in the
        middle of three planned displacements."""
        (v, a), place, n_a = _rates(planned, self._dt), self._model.at(planned[1]), self._model.n_a
        M, F = place.M, self._lost(place)
        eta = -np.linalg.solve(place.inner, M[n_a:, :n_a] @ a + F[n_a:, :n_a] @ v)
        by_turn = place.dM[:, :n_a, :n_a] @ v  # (n_a, n_a)
        forces = place.pull + M[:n_a, :n_a] @ a + F[:n_a, :n_a] @ v + v @ by_turn - by_turn @ v / 2
        return eta, forces

    def _lost(self, place: MotionTerms) -> np.ndarray:
        """Resistance to slow motion, (n_q, n_q)."""
        taus = [loss.relaxation + sum(share * tau for share, tau in loss.prony) for loss in self._model.losses]
        return np.tensordot(taus, place.F, 1) if taus else np.zeros_like(place.M)

    def _static(self, stage: int, goal: np.ndarray) -> np.ndarray:
        """Displacements (n_a,) mm that lead to a goal (n_e,) mm from rest, from those before of that stage."""
        self._place[stage] = drive(self._search, self._place[stage], goal)
        return self._place[stage].delta_a


def _three(value: np.ndarray) -> deque[np.ndarray]:
    return deque([value] * 3, maxlen=3)


def _rates(x: deque[np.ndarray], dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Central first and second differences a second of three values (n,)."""
    return (x[2] - x[0]) / (2 * dt), (x[2] - 2 * x[1] + x[0]) / dt**2
