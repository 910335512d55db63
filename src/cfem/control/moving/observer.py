"""Where the robot is and how it moves, from measured effectors: an extended Kalman filter of the condensed model
(Anderson and Moore, Optimal Filtering, 1979, chapter 8).

Beside the state it estimates the logarithms of the material's stiffness and viscosity over the model's, and an offset
of the effectors, which takes in what is wrong at rest: without one a controller that trusts the model does not end at
its goal (Pannocchia and Rawlings, AIChE J. 49, 2003). A late sample corrects the state of its own tick, from where the
commands given since lead to the present.

A sample that the filter does not expect is rejected (`cfem.predict.gate`), and so is one that repeats the one before to
the last bit although the robot should have moved. After a run of samples that do not fit but agree with each other, and
where the estimate is lost, the filter begins again at the model's equilibrium under the command of that tick, as
uncertain as such samples tell."""

from dataclasses import dataclass, field

import numpy as np

from cfem.condensed.model import under_force
from cfem.core.errors import InputError, NumericalError
from cfem.motion.clocked import Clocked, State
from cfem.motion.linear import Linear, Material, places
from cfem.motion.model import Place
from cfem.plant.protocol import Measurement
from cfem.predict.gate import MEMORY, Gate, GateSpec, Verdict

_KNOWN = 4.0  # standard deviations within which a logarithm of the material stays
_ASTRAY = (
    10.0  # of what it states: the mean square of a sample's miss at which the robot does not move as the model says
)
_SWING = 0.1  # of the square of what samples missed: that of a swing that they may be of
_FROZEN = 3.0  # of the noise: motion during which a sensor does not repeat itself


@dataclass(frozen=True)
class Doubt:
    """Standard deviations. noise: mm of each measured coordinate; stiffness, viscosity: of their logarithms at the
    start; wander: by which they change a second, as a share of that; offset: mm by which the effectors' offset changes
    a second (root of); push: mm by which forces that the model does not know move the effectors in a tick, at rest.
    gate: samples that are not heard."""

    noise: float = 0.1
    stiffness: float = 0.2
    viscosity: float = 0.3
    wander: float = 0.1
    offset: float = 0.3
    push: float = 0.03
    gate: GateSpec = field(default_factory=GateSpec)


class Observer:
    """state: at the tick of the last sample; material, offset (n_e,) mm: estimates; covariance (n, n) of state,
    material and offset; heard: tick of the last sample; innovation: the square of what the last sample missed of what
    was expected, over what the filter states of it: 1 on average."""

    def __init__(self, clocked: Clocked, start: State, weights: np.ndarray, doubt: Doubt):
        """start: where the robot stands before the first tick; weights (n_e,): rows of weight 0 are not measured."""
        self._clocked, self._doubt, self._measured = clocked, doubt, weights > 0
        self.heard, self.gate = 0, Gate.of(doubt.gate)
        self._commands: list[np.ndarray] = []
        self._places: list[Place | None] = []  # of the ticks of the commands
        self._place: Place | None = None  # of the last tick
        self._sample = self._expected = np.full(len(weights), np.nan)  # the last one, and what was expected of late
        self._n_z = clocked.n_z
        self._each = np.array([doubt.stiffness, doubt.viscosity])
        self._begin(start)

    def _begin(self, start: State) -> None:
        """At rest at `start`, where the model is as uncertain as stated."""
        clocked, doubt, n_e = self._clocked, self._doubt, len(self._measured)
        self.state, self.offset, self._log, self.innovation = start, np.zeros(n_e), np.zeros(2), 1.0
        n = self._n_z + 2 + n_e
        by_material = np.zeros((n, 2))
        by_material[self._n_z : self._n_z + 2] = np.diag(self._each)
        if clocked.kind == "force":  # a stiffer robot stands elsewhere
            place = clocked.model.at(start.z[: clocked.n_a])
            by_material[: clocked.n_a, 0] = -np.linalg.solve(place.stiff, place.pull) * doubt.stiffness
        self.covariance = by_material @ by_material.T
        offset = slice(self._n_z + 2, n)
        self.covariance[offset, offset] = doubt.offset**2 * np.eye(n_e)

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

    def hear(self, measured: Measurement | None, rest_e: np.ndarray) -> Verdict | None:
        """A sample, with the number of its tick, and what becomes of it; None of one heard before, which changes
        nothing, and of one without a position, which does not correct."""
        if measured is None or measured.t <= self.heard:
            return None
        if measured.t > self.heard + len(self._commands):
            what = f"the sample is of tick {measured.t}, and {self.heard + len(self._commands)} commands were given"
            raise InputError(what, do="number the samples by the command that they follow, from 1 on")
        ticks, verdict = measured.t - self.heard, None
        for u, place in zip(self._commands[:ticks], self._places[:ticks], strict=True):
            if not self._predict(u, place):
                verdict = Verdict.RESTART
        self._commands, self._places = self._commands[ticks:], self._places[ticks:]
        self.heard = measured.t
        if self._measured.any() and np.isfinite(measured.x_e[self._measured]).all():
            judged = self._judged(measured.x_e - rest_e)
            verdict = judged if verdict is None else verdict
        return verdict

    def _judged(self, delta_e: np.ndarray) -> Verdict:
        H, missed, S = self._innovation(delta_e)
        expected = delta_e[self._measured] - missed
        if not np.array_equal(delta_e[self._measured], self._sample):
            self._sample, self._expected = delta_e[self._measured], expected
        moved = expected - self._expected
        self._expected = self._expected + moved / MEMORY
        if np.sqrt(np.mean(moved**2)) > _FROZEN * self._doubt.noise:
            return Verdict.REJECTED
        square = float(missed @ np.linalg.solve(S, missed))
        self.innovation = square / len(missed)
        # a covariance that is none: beyond what the model knows, its stiffness may be negative
        verdict = self.gate.judge(square, len(missed)) if square >= 0 else Verdict.RESTART
        if verdict is Verdict.RESTART:
            size = float(missed @ missed) / len(missed)
            self.restart(self.state.u)
            _, missed, _ = self._innovation(delta_e)
            self._widen(max(size, float(missed @ missed) / len(missed)))
            H, missed, S = self._innovation(delta_e)
        if verdict is not Verdict.REJECTED:
            self._correct(H, missed, S)
        return Verdict.RESTART if self._again(self.state.u) else verdict

    def restart(self, u: np.ndarray) -> None:
        """Begins again at the model's equilibrium under the command u (n_a,), as uncertain as at first."""
        delta_a = np.asarray(u, float) if self._clocked.kind == "displacement" else self._equilibrium(u)
        self._begin(self._clocked.standing(delta_a, u))
        self._place = places(self._clocked.model, delta_a[None])
        self.gate.restart()

    def abandon(self, u: np.ndarray) -> None:
        """Begins again as `restart` does, without what is known of the ticks since the last sample."""
        self.restart(u)
        self._places = [None] * len(self._commands)

    def _equilibrium(self, u: np.ndarray) -> np.ndarray:
        """(n_a,) mm under forces u (n_a,), searched from where the robot was taken to be; the middle of what the model
        was trained on where it has none."""
        static, delta_a = self._clocked.model.static, self.state.z[: self._clocked.n_a]
        low, high = static.domain.delta_a
        near = np.clip(np.where(np.isfinite(delta_a), delta_a, (low + high) / 2), low, high)
        try:
            return under_force(static, u, static.at_displacement(near)).delta_a
        except NumericalError:
            return (low + high) / 2

    def now(self) -> State:
        """Where the commands given since the last sample have led. NumericalError where the model has no answer."""
        try:
            return self._forward()
        except (NumericalError, np.linalg.LinAlgError):
            self.abandon(self.state.u)
            return self._forward()

    def _forward(self) -> State:
        state, material = self.state, self.material
        for k, u in enumerate(self._commands):
            state, _, self._places[k] = self._clocked.step(state, u, material, self._places[k])
        if not np.isfinite(state.z).all():
            raise NumericalError("the observer has lost the robot: its estimate is not finite")
        return state

    def _predict(self, u: np.ndarray, place: Place | None) -> bool:
        """Whether the estimate was carried over a tick in which the command moves to u; else it began again."""
        try:
            self._carry(u, place)
        except (NumericalError, np.linalg.LinAlgError):
            self.restart(u)
            return False
        return not self._again(u)

    def _again(self, u: np.ndarray) -> bool:
        """Whether the estimate was lost, and began again."""
        finite = bool(np.isfinite(self.state.z.sum() + self.covariance.sum()))
        if not finite:
            self.restart(u)
        return not finite

    def _carry(self, u: np.ndarray, place: Place | None) -> None:
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

    def _widen(self, square: float) -> None:
        """Adds to the covariance an offset of mean square `square` (mm^2) in each coordinate, and a swing of the
        effectors of a share of that, with as much energy in each motion."""
        n_a, n_q, place = self._clocked.n_a, self._clocked.n_q, self._clocked.warped(self._place)
        free = slice(n_a if self._clocked.kind == "displacement" else 0, n_q)
        compliance = np.linalg.inv(place.K[0, free, free])
        J = np.concatenate([place.J[0], place.H[0]], axis=1)[:, free]
        moved = np.trace(J @ compliance @ J.T)
        energy = _SWING * square * len(J) / moved if moved > 0 else 0.0
        momenta = slice(n_q + free.start, 2 * n_q)
        self.covariance[free, free] += energy * compliance
        self.covariance[momenta, momenta] += energy * place.M[0, free, free]
        offset = np.arange(self._n_z + 2, len(self.covariance))
        self.covariance[offset, offset] += square

    def _innovation(self, delta_e: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Slopes (k, n) of what is measured by what is estimated, what a sample missed (k,) mm, and its covariance."""
        rows, n_z = self._measured, self._n_z
        expected, C = self._clocked.effectors(self.state.z[None], self._place)
        H = np.zeros((len(delta_e), len(self.covariance)))
        H[:, :n_z], H[:, n_z + 2 :] = C[0], np.eye(len(delta_e))
        H, missed = H[rows], (delta_e - expected[0] - self.offset)[rows]
        return H, missed, H @ self.covariance @ H.T + self._doubt.noise**2 * np.eye(len(missed))

    def _correct(self, H: np.ndarray, missed: np.ndarray, S: np.ndarray) -> None:
        P, R, n_z = self.covariance, self._doubt.noise**2 * np.eye(len(missed)), self._n_z
        gain = np.linalg.solve(S, H @ P).T
        change = gain @ missed
        keep = np.eye(len(P)) - gain @ H
        P = keep @ P @ keep.T + gain @ R @ gain.T  # Joseph's form: positive whatever rounding does
        self.covariance = (P + P.T) / 2
        self.state = State(self.state.z + change[:n_z], self.state.v, self.state.u)
        largest = _KNOWN * self._each
        self._log = np.clip(self._log + change[n_z : n_z + 2], -largest, largest)
        self.offset = self.offset + change[n_z + 2 :]
