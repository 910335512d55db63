"""Where the robot is and how it moves, from measured effectors: an extended Kalman filter of the condensed model
(Anderson and Moore, Optimal Filtering, 1979, chapter 8).

Beside the state it estimates the logarithms of the material's stiffness and viscosity over the model's, and an offset
of the effectors, which takes in what is wrong at rest: without one a controller that trusts the model does not end at
its goal (Pannocchia and Rawlings, AIChE J. 49, 2003). A late sample corrects the state of its own tick, from where the
commands given since lead to the present."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.motion.clocked import Clocked, State
from cfem.motion.linear import Linear, Material
from cfem.motion.model import Place
from cfem.plant.protocol import Measurement

_KNOWN = 4.0  # standard deviations within which a logarithm of the material stays
_ASTRAY = (
    10.0  # of what it states: the mean square of a sample's miss at which the robot does not move as the model says
)


@dataclass(frozen=True)
class Doubt:
    """Standard deviations. noise: mm of each measured coordinate; stiffness, viscosity: of their logarithms at the
    start; wander: by which they change a second, as a share of that; offset: mm by which the effectors' offset changes
    a second (root of); push: mm by which forces that the model does not know move the effectors in a tick, at rest."""

    noise: float = 0.1
    stiffness: float = 0.2
    viscosity: float = 0.3
    wander: float = 0.1
    offset: float = 0.3
    push: float = 0.03


class Observer:
    """state: at the tick of the last sample; material, offset (n_e,) mm: estimates; covariance (n, n) of state,
    material and offset; heard: tick of the last sample; innovation: the square of what the last sample missed of what
    was expected, over what the filter states of it: 1 on average."""

    def __init__(self, clocked: Clocked, start: State, weights: np.ndarray, doubt: Doubt):
        """start: where the robot stands before the first tick; weights (n_e,): rows of weight 0 are not measured."""
        self._clocked, self._doubt, self._measured = clocked, doubt, weights > 0
        self.state, self.offset = start, np.zeros(len(weights))
        self._log, self.heard, self.innovation = np.zeros(2), 0, 1.0
        self._commands: list[np.ndarray] = []
        self._places: list[Place | None] = []  # of the ticks of the commands
        self._place: Place | None = None  # of the last tick
        self._n_z = clocked.n_z
        self._each = np.array([doubt.stiffness, doubt.viscosity])
        n = self._n_z + 2 + len(weights)
        by_material = np.zeros((n, 2))
        by_material[self._n_z : self._n_z + 2] = np.diag(self._each)
        if clocked.kind == "force":  # a stiffer robot stands elsewhere
            place = clocked.model.at(start.z[: clocked.n_a])
            by_material[: clocked.n_a, 0] = -np.linalg.solve(place.stiff, place.pull) * doubt.stiffness
        self.covariance = by_material @ by_material.T
        offset = slice(self._n_z + 2, n)
        self.covariance[offset, offset] = doubt.offset**2 * np.eye(len(weights))

    @property
    def material(self) -> Material:
        """As estimated."""
        return Material(*np.exp(self._log).tolist())

    @property
    def astray(self) -> bool:
        """Whether the last sample is far beyond what was expected: then nobody should trust a plan."""
        return self.innovation > _ASTRAY

    def told(self, u: np.ndarray, place: Place | None = None) -> None:
        """The command (n_a,) of the next tick; place: whose inertia is taken for it, None: asked of the model."""
        self._commands.append(np.asarray(u, float))
        self._places.append(place)

    def hear(self, measured: Measurement | None, rest_e: np.ndarray) -> None:
        """A sample, with the number of its tick; one heard before changes nothing, and one without a position does not
        correct. NumericalError where the estimate is not finite."""
        if measured is None or measured.t <= self.heard:
            return
        if measured.t > self.heard + len(self._commands):
            what = f"the sample is of tick {measured.t}, and {self.heard + len(self._commands)} commands were given"
            raise InputError(what, do="number the samples by the command that they follow, from 1 on")
        ticks = measured.t - self.heard
        for u, place in zip(self._commands[:ticks], self._places[:ticks], strict=True):
            self._predict(u, place)
        self._commands, self._places = self._commands[ticks:], self._places[ticks:]
        self.heard = measured.t
        if np.isfinite(measured.x_e[self._measured]).all():
            self._correct(measured.x_e - rest_e)
        if not np.isfinite(self.state.z.sum() + self.covariance.sum()):
            raise NumericalError("the observer has lost the robot: its estimate is not finite")

    def now(self) -> State:
        """Where the commands given since the last sample have led."""
        state, material = self.state, self.material
        for k, u in enumerate(self._commands):
            state, _, self._places[k] = self._clocked.step(state, u, material, self._places[k])
        return state

    def _predict(self, u: np.ndarray, place: Place | None) -> None:
        state, steps, self._place = self._clocked.step(self.state, u, self.material, place)
        n_z, n = self._n_z, len(self.covariance)
        F = np.eye(n)
        F[:n_z, :n_z], F[:n_z, n_z : n_z + 2] = steps.A[0], steps.by_material[0]
        self.covariance = F @ self.covariance @ F.T
        self.covariance[:n_z, :n_z] += self._pushes(steps, self._place)
        dt, rest = self._clocked.dt, np.arange(n_z, n)
        grown = np.concatenate([(self._doubt.wander * self._each) ** 2, np.full(n - n_z - 2, self._doubt.offset**2)])
        self.covariance[rest, rest] += dt * grown
        self.state = state

    def _pushes(self, steps: Linear, place: Place) -> np.ndarray:
        """(n_z, n_z): of forces during a tick with a covariance in proportion to the stiffness, such that at rest they
        would move the effectors by `push`."""
        n_a = self._clocked.n_a
        K = self.material.stiffness * place.K[0]
        J = np.concatenate([place.J[0], place.H[0]], axis=1)
        free = slice(n_a, None) if self._clocked.kind == "displacement" else slice(None)
        moved = np.trace(J[:, free] @ np.linalg.solve(K[free, free], J[:, free].T)) / len(J)
        n_q, dt = self._clocked.n_q, self._clocked.dt
        by_push = dt / 2 * steps.A[0][:, n_q : 2 * n_q]  # a push is like momentum, half of it before the tick,
        by_push[n_q : 2 * n_q] += dt / 2 * np.eye(n_q)  # and half after
        by_push = by_push[:, free]
        return self._doubt.push**2 / moved * by_push @ K[free, free] @ by_push.T

    def _correct(self, delta_e: np.ndarray) -> None:
        rows, n_z = self._measured, self._n_z
        expected, C = self._clocked.effectors(self.state.z[None], self._place)
        H = np.zeros((len(delta_e), len(self.covariance)))
        H[:, :n_z], H[:, n_z + 2 :] = C[0], np.eye(len(delta_e))
        H, missed = H[rows], (delta_e - expected[0] - self.offset)[rows]
        P, R = self.covariance, self._doubt.noise**2 * np.eye(int(rows.sum()))
        S = H @ P @ H.T + R
        gain = np.linalg.solve(S, H @ P).T
        change = gain @ missed
        self.innovation = float(missed @ np.linalg.solve(S, missed)) / len(missed)
        keep = np.eye(len(P)) - gain @ H
        P = keep @ P @ keep.T + gain @ R @ gain.T  # Joseph's form: positive whatever rounding does
        self.covariance = (P + P.T) / 2
        self.state = State(self.state.z + change[:n_z], self.state.v, self.state.u)
        largest = _KNOWN * self._each
        self._log = np.clip(self._log + change[n_z : n_z + 2], -largest, largest)
        self.offset = self.offset + change[n_z + 2 :]
