"""Parameters of the robot that are tracked while it works: how soft it has become, how much its actuators lose.

After each sample of the effectors, an iterated extended Kalman filter with exponential forgetting (Astrom and
Wittenmark, *Adaptive Control*, 2nd ed. 1995, section 2.2) moves the parameters to what the sample says. Unknown are
shares z of the parameters' ranges, in the coordinates in which the model is smooth, losses b of the actuators, so that
the robot feels u - b, and the rates r per sample of those shares that drift, Young's modulus: without them, an estimate
trails a drift. A camera may have moved and turned by f (`cfem.control.adaptation.camera_frame`).
With F adding r to z, and x(z, b, f; u) the effectors that the camera shows of the model under the command,

    P' = min(F P F^T / forgetting, P_0)        J = dx/dz, dx/db, 0, dx/df

min: no direction becomes less certain than it was at first, so that forgetting without excitation does no harm. The
noise is the stated one, or what the samples of late have shown where that is more (the gate's spread). A controller
uses an estimate only where four guards let it:

- bounds: z stays in the range that the model was trained on, b and f within three standard deviations;
- gate: a sample that does not fit changes nothing; a run of such samples opens P again, whether or not they miss by as
  much, since each has another command (`cfem.predict.estimation.gate`);
- excitation: parameters count once the standard deviation of one has come down to half of its first, each number of
  f once its own has;
- proof: the estimate must have predicted the samples of late better than the first values do, else those are used;
  where it misses by more than 5 % of the robot's length, nothing that is used changes: no parameters explain the robot.

What is used changes by a bounded step a tick."""

from dataclasses import dataclass, field, replace

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.model import under_force
from cfem.control.adaptation.camera_frame import CameraFrame
from cfem.control.adaptation.unknowns import CAMERA, DRIFT, LOSS, SD, TrackedUnknowns
from cfem.core.errors import InputError, NumericalError
from cfem.plant.protocol import Command
from cfem.predict.at_parameters import AtParameters
from cfem.predict.estimation.fit import Search
from cfem.predict.estimation.gate import Gate, SampleVerdict
from cfem.predict.estimation.kalman import Gaussian, Update, gated_update
from cfem.predict.protocol import Predictor

STEP = 1e-3  # of a range: of differences
ITERATIONS, NEAR = 6, 0.02  # of an update; of the first standard deviation: a step that ends it
SEEN = 0.5  # of the first standard deviation: below it a parameter counts
FAR = 0.05  # of the robot's length: a model that misses by more says nothing of this robot
MOST = 0.05  # of a range, by which what is used changes in a tick


@dataclass
class Tracker:
    """The filter of the parameters, and the guards of what is used.

    predictor: a model with parameters
    command: what u is
    noise: mm, of each measured coordinate, with what the model misses
    find: names of the parameters, all unless given
    loss: mm or N, standard deviation of what an actuator loses, 0 for none
    forget: samples after which one counts for 1/e
    rows: (n_e,) effector rows that are measured, all unless given
    frame: mm and rad, standard deviations of the camera's motion, 0 where it stands still
    known: the distribution of the unknowns (unknowns.py)
    rejected: number of samples that were rejected, or that the model knows no state for
    """

    predictor: Predictor
    command: Command
    noise: float
    find: tuple[str, ...] | None = None
    loss: float = 0.0
    forget: float = 50.0
    rows: np.ndarray | None = None
    frame: tuple[float, float] = (0.0, 0.0)
    rejected: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        """Checks the stated numbers and prepares unknowns, bounds and gate. InputError where a number is out of its
        range."""
        if self.noise <= 0 or self.forget <= 1 or min(self.loss, *self.frame) < 0:
            raise InputError(
                "noise must be positive, forget above one sample, loss and frame not negative",
                do="correct these numbers",
            )
        self.unknowns = TrackedUnknowns(self.predictor, self.find, self.loss, self.frame, self.forget)
        self._camera = CameraFrame.of(self.predictor.rows, self.predictor.rest_e)
        self._rows = slice(None) if self.rows is None else self.rows
        first, sd = self.unknowns.first, self.unknowns.sd
        self.known, self._used = Gaussian(first.copy(), np.diag(sd**2)), first.copy()
        bounds = np.stack([self.unknowns.low, self.unknowns.high], axis=1)
        self._search = Search(sd, bounds, NEAR, ITERATIONS)
        self.gate = Gate(memory=self.forget, first=1.0, alike=np.inf)
        self._misses = {"tracked": 0.0, "first": 0.0}

    @property
    def p(self) -> np.ndarray:
        """Estimate (n_p,) of the parameters."""
        return self.unknowns.p(self.known.mean)

    @property
    def used_p(self) -> np.ndarray:
        """Parameters (n_p,) that the guards let through."""
        return self.unknowns.p(self._used)

    @property
    def used_b(self) -> np.ndarray:
        """Losses (n_a,) mm or N that the guards let through."""
        return self.unknowns.losses(self._used)

    @property
    def used_f(self) -> np.ndarray:
        """Motion (6,) mm and rad that the camera is taken to have made."""
        return self.unknowns.camera(self._used)

    def true(self, delta_e: np.ndarray) -> np.ndarray:
        """Places (n_e,) mm from rest of effectors that the camera shows at delta_e, its own motion taken off."""
        return self._camera.true(delta_e, self.used_f) if len(self.unknowns.moves) else delta_e

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviations (n,) of the unknowns: shares of ranges, losses in mm or N, rates in shares a sample."""
        return np.sqrt(np.diag(self.known.covariance))

    def sample(self, u: np.ndarray, delta_e: np.ndarray, near: Condensed) -> bool:
        """Takes a sample into the estimate and returns True if the values in use change. Never raises for what the
        numbers are.

        u (n_a,): the command that was sent; delta_e (n_e,) mm: where the effectors went, from rest; near: a state of
        the model near it."""
        measured = np.asarray(delta_e, float)[self._rows]
        if not np.isfinite(measured).all():
            return False
        predicted, first = self._predicted(), self.unknowns.first
        try:
            state = self._state(predicted.mean, u, near)
            first_state = self._state(first, u, near)
        except NumericalError:
            self.rejected += 1
            return self._use()
        self._prove(measured - self._shown(predicted.mean, state), measured - self._shown(first, first_state))
        update, verdict = gated_update(
            self.gate,
            predicted,
            lambda: Gaussian(predicted.mean, np.diag(self.unknowns.sd**2)),
            lambda prior: self._update(prior, measured, u, state),
        )
        if verdict is SampleVerdict.REJECTED:
            self.rejected += 1
        else:
            self.known = update.posterior
        return self._use()

    def _update(self, prior: Gaussian, measured: np.ndarray, u: np.ndarray, state: Condensed) -> Update:
        """The update of a prior by measured (k,) mm under the command u; state: at the prior's mean.

        Its square is normalised by the stated noise, as the gate has a spread of its own; it is infinite where the
        model has no answer."""
        spread, latest = self.gate.spread, state

        def expected(x: np.ndarray) -> np.ndarray:
            nonlocal latest
            latest = state if x is prior.mean else self._state(x, u, latest)
            return self._shown(x, latest)

        noise = self.noise**2 * spread * np.eye(len(measured))
        try:
            update = prior.iterated(measured, expected, lambda x: self._slopes(x, latest), noise, self._search)
        except NumericalError:
            return Update(prior, np.inf, len(measured))
        return replace(update, square=spread * update.square)

    def _use(self) -> bool:
        """Decides which values are used and returns True if they change: the estimate where it is excited and explains
        the robot, the values as they are where it does not, and the first ones where the estimate is not proved."""
        kinds, sd = self.unknowns.kinds, self.unknowns.sd
        observed, camera = self.deviation < SEEN * sd, kinds == CAMERA
        excited = np.where(camera, observed, observed[kinds < DRIFT].any())
        fits = self.noise * np.sqrt(self.gate.spread) <= FAR * self.predictor.length
        proved = self._misses["tracked"] <= self._misses["first"]
        wanted = np.where(excited & fits, self.known.mean, self._used) if proved else self.unknowns.first
        most = MOST * np.where((kinds == LOSS) | camera, sd / SD, 1.0)
        moved = self._used + np.clip(wanted - self._used, -most, most)
        changed = not np.array_equal(moved, self._used)
        self._used = moved
        return changed

    def _prove(self, tracked: np.ndarray, first: np.ndarray) -> None:
        """Adds the squares of what the estimate and the first values failed to predict to sums that forget."""
        keeps = np.exp(-1.0 / self.forget)
        for name, missing in (("tracked", tracked), ("first", first)):
            self._misses[name] = keeps * self._misses[name] + float(missing @ missing)

    def _predicted(self) -> Gaussian:
        """The distribution before the next sample: P over the forgetting factors, no direction beyond its first
        covariance."""
        unknowns, across = self.unknowns, np.outer(self.unknowns.sd, self.unknowns.sd)
        mean = np.clip(unknowns.transition @ self.known.mean, unknowns.low, unknowns.high)
        F = unknowns.growth[:, None] * unknowns.transition
        P = self.known.predicted(mean, F, np.zeros_like(F)).covariance / across
        size, axes = np.linalg.eigh((P + P.T) / 2)
        return Gaussian(mean, (axes * np.clip(size, 0.0, 1.0)) @ axes.T * across)

    def _state(self, x: np.ndarray, u: np.ndarray, near: Condensed) -> Condensed:
        """The model's state with the unknowns x (n,) under the command u (n_a,)."""
        model, felt = AtParameters(self.predictor, self.unknowns.p(x)), u - self.unknowns.losses(x)
        if self.command == "displacement":
            return model.at_displacement(felt)
        return under_force(model, felt, model.at_displacement(near.delta_a))  # near is of other parameters

    def _slopes(self, x: np.ndarray, state: Condensed) -> np.ndarray:
        """Slopes (k, n) of the measured rows by x (n,), at the state there. By z from states beside this one at the
        same displacements, corrected to the same forces."""
        forced, columns, unknowns = self.command == "force", [], self.unknowns
        for i in range(len(unknowns.find)):
            low, high = max(x[i] - STEP, 0.0), min(x[i] + STEP, 1.0)
            ends = []
            for share in (low, high):
                beside = x.copy()
                beside[i] = share
                end = self.predictor.at_displacement(state.delta_a, unknowns.p(beside))
                ends.append(end.delta_e + (state.W_ea @ (state.lambda_a - end.lambda_a) if forced else 0.0))
            columns.append((ends[1] - ends[0]) / (high - low))
        J = np.zeros((len(state.delta_e), len(x)))
        J[:, : len(columns)] = np.array(columns).reshape(-1, len(J)).T
        if self.loss:
            J[:, unknowns.kinds == LOSS] = -state.W_ea if forced else -state.effector_jacobian
        if len(unknowns.moves):
            motion = unknowns.camera(x)
            J = self._camera.turned(J, motion)
            J[:, unknowns.kinds == CAMERA] = self._camera.slopes(state.delta_e, motion)[:, unknowns.moves]
        return J[self._rows]

    def _shown(self, x: np.ndarray, state: Condensed) -> np.ndarray:
        """Measured rows (k,) mm from rest as the camera shows them."""
        moves = len(self.unknowns.moves)
        return (self._camera.shown(state.delta_e, self.unknowns.camera(x)) if moves else state.delta_e)[self._rows]
