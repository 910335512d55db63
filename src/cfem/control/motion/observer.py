"""Where the robot is and how it moves, from measured effectors: an extended Kalman filter of the condensed model
(Anderson and Moore, Optimal Filtering, 1979, chapter 8).

Beside the state it estimates the logarithms of the material's stiffness and viscosity over the model's, and an offset
of the effectors, which takes in what is wrong at rest: without one a controller that trusts the model does not end at
its goal (Pannocchia and Rawlings, AIChE J. 49, 2003). A late sample corrects the state of its own tick, from where the
commands given since lead to the present.

A sample that the filter does not expect is rejected (`cfem.predict.estimation.gate`), and so is one that repeats the
one before to the last bit although the robot should have moved. After a run of samples that do not fit but agree with
each other, and where the estimate is lost, the filter begins again at the model's equilibrium under the command of that
tick, as uncertain as such samples tell.

The update is by the gain, not by least squares: after a start at rest the covariance of the state is singular."""

from dataclasses import dataclass, field, replace

import numpy as np

from cfem.condensed.model import under_force
from cfem.core.errors import InputError, NumericalError
from cfem.motion.clocked import Clocked, ClockedState
from cfem.motion.estimation.pushes import mean_compliance, push_covariance, slope_by_force
from cfem.motion.linear import MaterialShares, places
from cfem.motion.model import MotionTerms
from cfem.plant.protocol import Measurement
from cfem.predict.estimation.gate import MEMORY, Gate, GateSpec, SampleVerdict
from cfem.predict.estimation.kalman import Gaussian, Update, gated_update

_KNOWN = 4.0  # standard deviations within which a logarithm of the material stays
_ASTRAY = (
    10.0  # of what it states: the mean square of a sample's miss at which the robot does not move as the model says
)
_SWING = 0.1  # of the square of what samples missed: that of a swing that they may be of
_FROZEN = 3.0  # of the noise: motion during which a sensor does not repeat itself


@dataclass(frozen=True)
class Doubt:
    """Standard deviations of what the model does not know.

    noise: mm of each measured coordinate
    stiffness, viscosity: of their logarithms at the start
    wander: change of these logarithms in a second, as a share of that
    offset: mm by which the effectors' offset changes in a second (root of)
    push: mm by which forces that the model does not know move the effectors in a tick, at rest
    gate: of samples that do not fit
    """

    noise: float = 0.1
    stiffness: float = 0.2
    viscosity: float = 0.3
    wander: float = 0.1
    offset: float = 0.3
    push: float = 0.03
    gate: GateSpec = field(default_factory=GateSpec)


class Observer:
    """Filter of measured effectors.

    state: at the tick of the last sample
    material, offset (n_e,) mm: estimates
    covariance: (n, n) of the state, the logarithms of stiffness and viscosity, and the offset
    sampled: tick of the last sample
    innovation: square of the last sample's miss over what the filter states of it: 1 on average
    """

    def __init__(self, clocked: Clocked, start: ClockedState, weights: np.ndarray, doubt: Doubt):
        """start: where the robot stands before the first tick; weights (n_e,): rows of weight 0 are not measured."""
        self._clocked, self._doubt, self._measured = clocked, doubt, weights > 0
        self.sampled, self.gate = 0, Gate.of(doubt.gate)
        self._commands: list[np.ndarray] = []
        self._places: list[MotionTerms | None] = []  # of the ticks of the commands
        self._place: MotionTerms | None = None  # of the last tick
        self._sample = self._expected = np.full(len(weights), np.nan)  # the last one, and what was expected of late
        self._n_z = clocked.n_z
        self._logs, self._offsets = slice(self._n_z, self._n_z + 2), slice(self._n_z + 2, None)
        self._free = slice(clocked.n_a if clocked.kind == "displacement" else 0, clocked.n_q)  # no actuator holds
        self._log_deviation = np.array([doubt.stiffness, doubt.viscosity])
        self._begin(start)

    def _begin(self, start: ClockedState) -> None:
        """Sets the state to rest at `start`, with the stated uncertainty of the model."""
        clocked, doubt, n_e = self._clocked, self._doubt, len(self._measured)
        n = self._n_z + 2 + n_e
        by_material = np.zeros((n, 2))
        by_material[self._logs] = np.diag(self._log_deviation)
        if clocked.kind == "force":  # a stiffer robot stands elsewhere
            place = clocked.model.at(start.z[: clocked.n_a])
            by_material[: clocked.n_a, 0] = -np.linalg.solve(place.stiff, place.pull) * doubt.stiffness
        covariance = by_material @ by_material.T
        covariance[self._offsets, self._offsets] = doubt.offset**2 * np.eye(n_e)
        self._known = Gaussian(np.concatenate([start.z, np.zeros(2 + n_e)]), covariance)
        self._velocity, self._command, self.innovation = start.v, start.u, 1.0

    @property
    def state(self) -> ClockedState:
        return ClockedState(self._known.mean[: self._n_z], self._velocity, self._command)

    @property
    def offset(self) -> np.ndarray:
        return self._known.mean[self._offsets]

    @property
    def covariance(self) -> np.ndarray:
        return self._known.covariance

    @property
    def material(self) -> MaterialShares:
        return MaterialShares(*np.exp(self._known.mean[self._logs]).tolist())

    @property
    def astray(self) -> bool:
        """True if the last sample is far beyond what was expected: then nobody should trust a plan."""
        return self.innovation > _ASTRAY

    def command(self, u: np.ndarray, place: MotionTerms | None = None) -> None:
        """Appends the command (n_a,) of the next tick; place: whose inertia is taken for it, the model's unless
        given."""
        self._commands.append(np.asarray(u, float))
        self._places.append(place)

    def correct(self, measured: Measurement | None, rest_e: np.ndarray) -> SampleVerdict | None:
        """Verdict on a sample, with the number of its tick. None for one that was used before, which changes nothing,
        and for one without a position, which does not correct."""
        if measured is None or measured.t <= self.sampled:
            return None
        if measured.t > self.sampled + len(self._commands):
            what = f"the sample is of tick {measured.t}, and {self.sampled + len(self._commands)} commands were given"
            raise InputError(what, do="number the samples by the command that they follow, from 1 on")
        ticks, verdict = measured.t - self.sampled, None
        for u, place in zip(self._commands[:ticks], self._places[:ticks], strict=True):
            if not self._predict(u, place):
                verdict = SampleVerdict.RESTART
        self._commands, self._places = self._commands[ticks:], self._places[ticks:]
        self.sampled = measured.t
        if self._measured.any() and np.isfinite(measured.x_e[self._measured]).all():
            judged = self._judged((measured.x_e - rest_e)[self._measured])
            verdict = judged if verdict is None else verdict
        return verdict

    def _judged(self, sample: np.ndarray) -> SampleVerdict:
        """The verdict on a sample (k,) mm from rest, by which the state is corrected unless it is rejected."""
        predicted = self._known
        expected, slope = self._expected_rows(predicted)
        if self._repeats(sample, expected):
            return SampleVerdict.REJECTED

        def update(known: Gaussian) -> Update:
            rows = (expected, slope) if known is predicted else self._expected_rows(known)
            return self._update(known, sample, *rows)

        correction, verdict = gated_update(self.gate, predicted, lambda: self._first(sample, expected), update)
        if verdict is not SampleVerdict.REJECTED:
            self._known = correction.posterior
        self.innovation = 1.0 if verdict is SampleVerdict.RESTART else correction.square / len(sample)
        return SampleVerdict.RESTART if self._restart_if_lost(self._command) else verdict

    def _repeats(self, sample: np.ndarray, expected: np.ndarray) -> bool:
        """True if a sample repeats the one before to the last bit although the robot should have moved."""
        if not np.array_equal(sample, self._sample):
            self._sample, self._expected = sample, expected
        moved = expected - self._expected
        self._expected = self._expected + moved / MEMORY
        return bool(np.sqrt(np.mean(moved**2)) > _FROZEN * self._doubt.noise)

    def _update(self, known: Gaussian, sample: np.ndarray, expected: np.ndarray, slope: np.ndarray) -> Update:
        """Update by a sample (k,) mm from rest; expected (k,) mm, slope (k, n): as of `_expected_rows`."""
        noise = self._doubt.noise**2 * np.eye(len(sample))
        update = known.updated(slope, sample - expected, noise)
        mean, largest = update.posterior.mean.copy(), _KNOWN * self._log_deviation
        mean[self._logs] = np.clip(mean[self._logs], -largest, largest)
        return replace(update, posterior=replace(update.posterior, mean=mean))

    def _expected_rows(self, known: Gaussian) -> tuple[np.ndarray, np.ndarray]:
        """Measured rows (k,) mm from rest that `known` leads one to expect, and their slope (k, n) by it."""
        delta_e, C = self._clocked.effectors(known.mean[None, : self._n_z], self._place)
        slope = np.zeros((len(self._measured), len(known.mean)))
        slope[:, : self._n_z], slope[:, self._offsets] = C[0], np.eye(len(slope))
        return (delta_e[0] + known.mean[self._offsets])[self._measured], slope[self._measured]

    def _first(self, sample: np.ndarray, expected: np.ndarray) -> Gaussian:
        """Distribution at the model's equilibrium, so wide that it allows for the sample (k,) mm; expected (k,) mm:
        before the restart."""
        self.restart(self._command)
        at_rest, _ = self._expected_rows(self._known)
        return self._widened(max(float(np.mean((sample - shown) ** 2)) for shown in (expected, at_rest)))

    def restart(self, u: np.ndarray) -> None:
        """Begins again at the model's equilibrium under the command u (n_a,), as uncertain as at first."""
        delta_a = np.asarray(u, float) if self._clocked.kind == "displacement" else self._equilibrium(u)
        self._begin(self._clocked.standing(delta_a, u))
        self._place = places(self._clocked.model, delta_a[None])
        self.gate.restart()

    def reset(self, u: np.ndarray) -> None:
        """Begins again as `restart` does, without what is known of the ticks since the last sample."""
        self.restart(u)
        self._places = [None] * len(self._commands)

    def _equilibrium(self, u: np.ndarray) -> np.ndarray:
        """Displacements (n_a,) mm under forces u (n_a,), searched from where the robot was taken to be; the middle of
        what the model was trained on where it has none."""
        static, delta_a = self._clocked.model.static, self.state.z[: self._clocked.n_a]
        low, high = static.domain.delta_a
        near = np.clip(np.where(np.isfinite(delta_a), delta_a, (low + high) / 2), low, high)
        try:
            return under_force(static, u, static.at_displacement(near)).delta_a
        except NumericalError:
            return (low + high) / 2

    def now(self) -> ClockedState:
        """State to which the commands given since the last sample have led. NumericalError where the model has no
        answer."""
        try:
            return self._present()
        except (NumericalError, np.linalg.LinAlgError):
            self.reset(self._command)
            return self._present()

    def _present(self) -> ClockedState:
        """The state after the commands given since the last sample."""
        state, material = self.state, self.material
        for k, u in enumerate(self._commands):
            state, _, self._places[k] = self._clocked.step(state, u, material, self._places[k])
        if not np.isfinite(state.z).all():
            raise NumericalError("the observer has lost the robot: its estimate is not finite")
        return state

    def _predict(self, u: np.ndarray, place: MotionTerms | None) -> bool:
        """Carries the estimate over a tick in which the command moves to u; False where it began again."""
        try:
            self._step(u, place)
        except (NumericalError, np.linalg.LinAlgError):
            self.restart(u)
            return False
        return not self._restart_if_lost(u)

    def _restart_if_lost(self, u: np.ndarray) -> bool:
        """Begins again where the estimate is not finite, and returns True if so."""
        lost = not np.isfinite(self._known.mean[: self._n_z].sum() + self.covariance.sum())
        if lost:
            self.restart(u)
        return bool(lost)

    def _step(self, u: np.ndarray, place: MotionTerms | None) -> None:
        """The transition over a tick in which the command moves to u."""
        material, doubt, clocked, n_z = self.material, self._doubt, self._clocked, self._n_z
        state, steps, self._place = clocked.step(self.state, u, material, place)
        n = len(self.covariance)
        F, Q = np.eye(n), np.zeros((n, n))
        F[:n_z, :n_z], F[:n_z, self._logs] = steps.A[0], steps.by_material[0]
        by_force = slope_by_force(steps.A[0], clocked.n_q, clocked.dt)
        Q[:n_z, :n_z] = push_covariance(by_force, self._place, material.stiffness, self._free, doubt.push)
        Q[self._logs, self._logs] = clocked.dt * np.diag((doubt.wander * self._log_deviation) ** 2)
        Q[self._offsets, self._offsets] = clocked.dt * doubt.offset**2 * np.eye(len(self._measured))
        mean = np.concatenate([state.z, self._known.mean[n_z:]])
        self._known = self._known.predicted(mean, F, Q)
        self._velocity, self._command = state.v, state.u

    def _widened(self, square: float) -> Gaussian:
        """Distribution with an offset of mean square `square` (mm^2) in each coordinate added, and a swing of the
        effectors of a share of that, with as much energy in each motion."""
        n_q, free, place = self._clocked.n_q, self._free, self._clocked.warped(self._place)
        K = place.K[0, free, free]
        compliance = mean_compliance(place, free, K)
        energy = _SWING * square / compliance if compliance > 0 else 0.0
        momenta = slice(n_q + free.start, 2 * n_q)
        covariance = self.covariance.copy()
        covariance[free, free] += energy * np.linalg.inv(K)
        covariance[momenta, momenta] += energy * place.M[0, free, free]
        covariance[self._offsets, self._offsets] += square * np.eye(len(self._measured))
        return Gaussian(self._known.mean, covariance)
