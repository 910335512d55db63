"""Parameters of the robot that are tracked while it works: how soft it has become, how much its actuators lose.

After each sample of the effectors, an extended Kalman filter with exponential forgetting (Astrom and Wittenmark,
*Adaptive Control*, 2nd ed. 1995, section 2.2) moves the parameters to what the sample says. Unknown are shares z of the
parameters' ranges, in the coordinates in which the model is smooth, losses b of the actuators, so that the robot feels
u - b, and the rates r per sample of those shares that drift, Young's modulus: without them, an estimate trails a drift.
A camera may have moved and turned by f (`cfem.control.camera_frame`).
With the effectors x(z, b, f; u) that the camera shows of the model under the command, and F adding r to z,

    J = dx/dz, dx/db, 0, dx/df     P' = min(F P F^T / forgetting, P_0)     K = P' J^T (J P' J^T + R)^-1

min: no direction becomes less certain than it was at first, so that forgetting without excitation does no harm. A
controller uses an estimate only where four guards let it:

- bounds: z stays in the range that the model was trained on, b and f within three standard deviations;
- gate: a sample that is not likely under P' and R (1 in 1000) changes nothing; only a long run of them opens P again.
  R is the square of the stated noise, or what the samples of late have shown where that is more;
- excitation: parameters count once the standard deviation of one has come down to half of its first, each number of
  f once its own has;
- proof: the estimate must have predicted the samples of late better than the first values do, else those are used;
  where it misses by more than 5 % of the robot's length, nothing that is used changes: no parameters explain the robot.

What is used changes by a bounded step a tick."""

from dataclasses import dataclass, field

import numpy as np
from scipy.special import chdtri

from cfem.condensed import Condensed
from cfem.condensed.model import under_force
from cfem.condensed.parameters import coordinates, range_coordinates, references, values
from cfem.control.camera_frame import CameraFrame
from cfem.core.errors import InputError, NumericalError
from cfem.plant.protocol import Command
from cfem.predict.at_parameters import AtParameters
from cfem.predict.protocol import Predictor

SD = 0.3  # of a parameter's range: about that of a uniform distribution
STEP = 1e-3  # of a range: of differences
GATE = 0.999
ITERATIONS, NEAR = 6, 0.02  # of an update; of the first standard deviation: a step that ends it
SEEN = 0.5  # of the first standard deviation: below it a parameter counts
FAR = 0.05  # of the robot's length: a model that misses by more says nothing of this robot
STEADY = 100.0  # times as long are samples kept of what does not change with time
PATIENCE = 20  # refused samples after which the robot has changed
RATE = 20.0  # times `forget`: in so many samples a drift crosses a parameter's standard deviation
MOST = 0.05  # of a range, by which what is used changes in a tick


@dataclass
class Tracker:
    """predictor: with parameters; command: what u is; noise: mm, of each measured coordinate, what the model misses
    included; find: names of the parameters, all unless given; loss: mm or N, standard deviation of what an actuator
    loses, 0 for none; forget: samples after which one counts for 1/e; frame: mm and rad, standard deviations of what a
    camera may have moved and turned, 0 for what it has not.

    z, b, f: the estimate; P: its covariance; used_p (n_p,), used_b (n_a,), used_f (6,): what the guards let through."""

    predictor: Predictor
    command: Command
    noise: float
    find: tuple[str, ...] | None = None
    loss: float = 0.0
    forget: float = 50.0
    rows: np.ndarray | None = None
    frame: tuple[float, float] = (0.0, 0.0)
    refused: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        names = [one.name for one in self.predictor.parameters]
        wanted = names if self.find is None else list(self.find)
        strange = [name for name in wanted if name not in names]
        if strange or not (wanted or self.loss or any(self.frame)):
            what = f"the model has no parameter '{strange[0]}'" if strange else "the model has no parameters to track"
            raise InputError(what, do=f"known are {', '.join(names) or 'none'}")
        if self.noise <= 0 or self.forget <= 1 or min(self.loss, *self.frame) < 0:
            raise InputError(
                "noise must be positive, forget above one sample, loss and frame not negative",
                do="correct these numbers",
            )
        own = self.predictor.parameters
        self._find = [names.index(name) for name in wanted]
        self._ends = np.array(range_coordinates(own))
        self._q = coordinates(own, references(own))
        n_a = self.predictor.rows.n_a
        n_b, drifting = n_a if self.loss else 0, [n for n, i in enumerate(self._find) if own[i].exact]
        n_r = len(drifting)
        moves = np.repeat(self.frame, 3)
        self._moves = np.flatnonzero(moves)
        self._camera, n_f = CameraFrame.of(self.predictor.rows, self.predictor.rest_e), len(self._moves)
        self._first = np.concatenate([self._share(self._q)[self._find], np.zeros(n_b + n_r + n_f)])
        plain = np.repeat([SD, self.loss, SD / (RATE * self.forget)], [len(wanted), n_b, n_r])
        self._sd = np.concatenate([plain, moves[self._moves]])
        lasting = np.array([not own[i].exact for i in self._find] + [False] * (n_b + n_r) + [True] * n_f)
        self._grows = np.exp(0.5 / np.where(lasting, STEADY * self.forget, self.forget))
        self._F = np.eye(len(self._first))
        self._F[drifting, len(wanted) + n_b + np.arange(n_r)] = 1.0
        self._kinds = np.repeat([0, 1, 2, 3], [len(wanted), n_b, n_r, n_f])
        self.x, self.P = self._first.copy(), np.diag(self._sd**2)
        self._used, self._rows = self._first.copy(), slice(None) if self.rows is None else self.rows
        self._misses = {"tracked": 0.0, "first": 0.0}
        self._in_a_row, self._spread = 0, 1.0

    @property
    def p(self) -> np.ndarray:
        """(n_p,) the estimate."""
        return self._p(self.x)

    @property
    def used_p(self) -> np.ndarray:
        return self._p(self._used)

    @property
    def used_b(self) -> np.ndarray:
        return self._b(self._used)

    @property
    def used_f(self) -> np.ndarray:
        """(6,) mm and rad by which the camera is taken to have moved."""
        return self._f(self._used)

    def true(self, delta_e: np.ndarray) -> np.ndarray:
        """(n_e,) mm from rest: where effectors are that the camera shows at delta_e."""
        return self._camera.true(delta_e, self.used_f) if len(self._moves) else delta_e

    @property
    def deviation(self) -> np.ndarray:
        """(n,) of what is tracked: shares of ranges, losses in mm or N, rates in shares a sample."""
        return np.sqrt(np.diag(self.P))

    def sample(self, u: np.ndarray, delta_e: np.ndarray, near: Condensed) -> bool:
        """u (n_a,): the command that was sent; delta_e (n_e,) mm: where the effectors went, from rest; near: a state of
        the model near it. Whether what is used has changed. Never raises for what the numbers are."""
        seen = np.asarray(delta_e, float)[self._rows]
        if not np.isfinite(seen).all():
            return False
        low, high = self._bounds
        ahead = np.clip(self._F @ self.x, low, high)
        try:
            here = self._state(ahead, u, near)
            first = self._state(self._first, u, near)
        except NumericalError:
            return self._use()
        P = self._forgotten()
        self._prove(seen - self._shown(ahead, here), seen - self._shown(self._first, first))
        R = self.noise**2 * self._spread * np.eye(len(seen))
        x, covariance, size = self._corrected(ahead, P, R, seen, u, here)
        most = chdtri(len(seen), 1 - GATE)  # of chi-squared
        self._spread = max(1.0, self._spread * (1 + (min(size, most) / len(seen) - 1) / self.forget))
        if not size <= most:
            self.refused += 1
            self._in_a_row += 1
            if self._in_a_row >= PATIENCE:
                self.P, self._in_a_row = np.diag(self._sd**2), 0
            return self._use()
        self._in_a_row = 0
        self.x, self.P = x, covariance
        return self._use()

    def _corrected(
        self, ahead: np.ndarray, P: np.ndarray, R: np.ndarray, seen: np.ndarray, u: np.ndarray, here: Condensed
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """The iterated update (Bell and Cathey 1993), linearised again where it leads while that is far: x, P, and the
        sum of squares that is left, whose distribution is chi-squared of as many numbers as were seen."""
        low, high = self._bounds
        x, missing, near = ahead, seen - self._shown(ahead, here), False
        for _ in range(ITERATIONS):
            J = self._slopes(x, here)
            K = np.linalg.solve(J @ P @ J.T + R, J @ P).T
            new = np.clip(ahead + K @ (missing - J @ (ahead - x)), low, high)
            near = bool(np.abs((new - x) / self._sd).max() < NEAR)
            try:
                here = self._state(new, u, here)
            except NumericalError:
                return x, P, np.inf
            x, missing = new, seen - self._shown(new, here)
            if near:
                break
        keep = np.eye(len(x)) - K @ J
        moved = (x - ahead) / self._sd
        size = missing @ np.linalg.solve(R, missing)
        size += moved @ np.linalg.solve(P / np.outer(self._sd, self._sd) + 1e-12 * np.eye(len(x)), moved)
        return x, keep @ P @ keep.T + K @ R @ K.T, float(size)  # Joseph's form stays positive

    def _use(self) -> bool:
        """What the controller uses: the estimate where it is excited and explains the robot, else what it used before;
        the first values where the estimate is not proved."""
        told, camera = self.deviation < SEEN * self._sd, self._kinds == 3
        seen = np.where(camera, told, told[self._kinds < 2].any())
        fits = self.noise * np.sqrt(self._spread) <= FAR * self.predictor.length
        proved = self._misses["tracked"] <= self._misses["first"]
        wanted = np.where(seen & fits, self.x, self._used) if proved else self._first
        most = MOST * np.where((self._kinds == 1) | camera, self._sd / SD, 1.0)
        moved = self._used + np.clip(wanted - self._used, -most, most)
        changed = not np.array_equal(moved, self._used)
        self._used = moved
        return changed

    def _prove(self, tracked: np.ndarray, first: np.ndarray) -> None:
        """Forgetting sums of squares of what estimate and first values failed to predict; large misses count alike."""
        keeps = np.exp(-1.0 / self.forget)
        for name, missing in (("tracked", tracked), ("first", first)):
            self._misses[name] = keeps * self._misses[name] + float(missing @ missing)

    def _forgotten(self) -> np.ndarray:
        """P over the forgetting factors, no direction beyond its first covariance."""
        P = (self._F @ self.P @ self._F.T) * np.outer(self._grows, self._grows) / np.outer(self._sd, self._sd)
        size, axes = np.linalg.eigh((P + P.T) / 2)
        return (axes * np.clip(size, 0.0, 1.0)) @ axes.T * np.outer(self._sd, self._sd)

    def _state(self, x: np.ndarray, u: np.ndarray, near: Condensed) -> Condensed:
        model, felt = AtParameters(self.predictor, self._p(x)), u - self._b(x)
        if self.command == "displacement":
            return model.at_displacement(felt)
        return under_force(model, felt, model.at_displacement(near.delta_a))  # near is of other parameters

    def _slopes(self, at: np.ndarray, here: Condensed) -> np.ndarray:
        """(rows, n): by z from states beside this one at the same displacements, corrected to the same forces."""
        forced, by = self.command == "force", []
        for i in range(len(self._find)):
            low, high = max(at[i] - STEP, 0.0), min(at[i] + STEP, 1.0)
            ends = []
            for share in (low, high):
                x = at.copy()
                x[i] = share
                beside = self.predictor.at_displacement(here.delta_a, self._p(x))
                ends.append(beside.delta_e + (here.W_ea @ (here.lambda_a - beside.lambda_a) if forced else 0.0))
            by.append((ends[1] - ends[0]) / (high - low))
        J = np.array(by).reshape(-1, len(here.delta_e)).T
        if self.loss:
            J = np.hstack([J, -here.W_ea if forced else -here.effector_jacobian])
        moved, n_f = self._f(at), len(self._moves)
        J = np.pad(J, ((0, 0), (0, len(at) - n_f - J.shape[1])))
        if n_f:
            by_f = self._camera.slopes(here.delta_e, moved)[:, self._moves]
            J = np.hstack([self._camera.turned(J, moved), by_f])
        return J[self._rows]

    def _shown(self, x: np.ndarray, here: Condensed) -> np.ndarray:
        """(rows,) mm from rest, as the camera shows it."""
        return (self._camera.shown(here.delta_e, self._f(x)) if len(self._moves) else here.delta_e)[self._rows]

    def _f(self, x: np.ndarray) -> np.ndarray:
        found = np.zeros(6)
        found[self._moves] = x[self._kinds == 3]
        return found

    @property
    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        return np.where(self._kinds == 0, 0.0, -3 * self._sd), np.where(self._kinds == 0, 1.0, 3 * self._sd)

    def _share(self, q: np.ndarray) -> np.ndarray:
        low, high = self._ends
        return (q - low) / (high - low)

    def _p(self, x: np.ndarray) -> np.ndarray:
        if not len(self._q):
            return self._q
        q, (low, high) = self._q.copy(), self._ends
        q[self._find] = (low + (high - low) * self._padded(x))[self._find]
        return values(self.predictor.parameters, q)

    def _padded(self, x: np.ndarray) -> np.ndarray:
        full = np.zeros(len(self._q))
        full[self._find] = x[: len(self._find)]
        return full

    def _b(self, x: np.ndarray) -> np.ndarray:
        return x[self._kinds == 1] if self.loss else np.zeros(self.predictor.rows.n_a)
