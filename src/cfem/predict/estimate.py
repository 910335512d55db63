"""Where the whole robot is, and who pushes it, from a few markers: one nonlinear least-squares problem a tick.

Unknown are the displacements delta_a of the actuators and forces w on chosen rows (effectors, or modes of the skin). A
marker m is a fixed mean of surface nodes, Phi_m of the modes; at a state it stands at

    y_m = X_m + Phi_m s        s = s_0(delta_a) + C_s,loads(delta_a) w

where s_0 and C are the model's (`cfem.predict.skin`). Sensors of the actuators, where there are any, measure delta_a.
The answer minimises the squares of what is missing, each over its own standard deviation: markers, sensors, and the
loads themselves, over what they are about at most (Gauss-Newton with Levenberg's damping). Its covariance is the
inverse of J^T J (Bard, *Nonlinear Parameter Estimation*, 1974, chapter 7). Markers that do not fit are found by the
weights of Geman and McClure (1987), left out and named; missing ones are NaN. Unknowns that the measurements do not
tell are named too."""

from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cfem.contact.triangles import closest
from cfem.core.errors import InputError
from cfem.predict.protocol import Predictor

ITERATIONS = 50
TOLERANCE = 1e-9  # of each unknown's scale: the last step
POLISH = 3  # last steps, by the markers that fit alone
UNSEEN = 0.3  # relative: an unknown whose standard deviation exceeds this share of its scale is not observed
OUTLIER = 4.0  # standard deviations at which a marker counts half
STEP = 1e-4  # of the reach: at which compliances are differenced by delta_a


class EstimateStatus(Enum):
    """How it ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    ITERATIONS = "the estimate keeps changing: the iterations allowed were used up"
    TOO_FEW = "fewer numbers are measured than are unknown"


@dataclass(frozen=True)
class Estimate:
    """One state. delta_a (n_a,) mm; loads (n_w,) N on the chosen rows; covariance (n_a + n_w, n_a + n_w) of both in
    this order; rows (k,) mm of the skin, and their covariance (k, k); delta_e (n_e,) mm; outliers: numbers of markers
    that do not fit; unseen: names of unknowns that the measurements do not tell; noise: root mean square of the
    residuals of the other markers over their standard deviation, about 1 or less where all is as assumed."""

    status: EstimateStatus
    delta_a: np.ndarray
    loads: np.ndarray
    covariance: np.ndarray
    rows: np.ndarray
    rows_covariance: np.ndarray
    delta_e: np.ndarray
    outliers: tuple[int, ...]
    unseen: tuple[str, ...]
    noise: float
    iterations: int

    @property
    def deviation(self) -> np.ndarray:
        """(n_a + n_w,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def converged(self) -> bool:
        return self.status is EstimateStatus.CONVERGED


@dataclass(frozen=True)
class Estimator:
    """markers (m, 3) mm: places on the surface at rest; noise: mm, standard deviation of each of their coordinates;
    loaded: names of rows on which forces are unknown, of effectors ('tip.x') or of the skin ('skin.1'); largest: N,
    standard deviation of such a force before anything is measured; sensor: mm, of the measured delta_a."""

    model: Predictor
    markers: np.ndarray
    noise: float
    loaded: tuple[str, ...] = ()
    largest: float = 1.0
    sensor: float = 0.01

    def __post_init__(self) -> None:
        if self.model.form != "displacement" or self.model.parameters:
            raise InputError("estimation needs a model of form displacement without parameters")
        if self.noise <= 0 or self.sensor <= 0 or self.largest <= 0:
            raise InputError("the noise of markers and sensors and the largest load must be positive")
        unknown = [name for name in self.loaded if name not in self._names]
        if unknown:
            raise InputError(f"the model has no row {unknown[0]!r}", do=f"known are {', '.join(self._names)}")
        away = self._nearest[1]
        if away.max(initial=0.0) > 0.05 * self.model.length:
            what = f"marker {int(away.argmax())} is {away.max():.3g} mm off the surface at rest"
            raise InputError(what, do="give markers at rest, in mm, in the frame of the scene")

    @property
    def _names(self) -> tuple[str, ...]:
        return self.model.rows.effectors + self.model.skin.names

    @cached_property
    def _nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """(m, 3) weights of three nodes each, as (node, weight) of the nearest triangle; distances (m,) mm."""
        rest, triangles = self.model.skin.rest, self.model.skin.triangles
        corners = rest[triangles]
        phi = np.zeros((len(self.markers), len(rest)))
        away = np.empty(len(self.markers))
        for number, point in enumerate(np.asarray(self.markers, float)):
            bary, distance = closest(corners, point)
            best = int(distance.argmin())
            phi[number, triangles[best]] = bary[best]
            away[number] = distance[best]
        return phi, away

    @cached_property
    def _phi(self) -> np.ndarray:
        """(m, 3, k): how the markers follow the modes."""
        return np.einsum("mn,kni->mik", self._nearest[0], self.model.skin.modes)

    @cached_property
    def _picked(self) -> np.ndarray:
        """(n_e + k, n_w) which rows the loads act on."""
        return np.eye(len(self._names))[:, [self._names.index(name) for name in self.loaded]]

    def seen(self, surface: np.ndarray) -> np.ndarray:
        """(m, 3) mm the markers on a surface whose nodes are at (n, 3) mm."""
        return self._nearest[0] @ surface

    def estimate(self, measured: ArrayLike, sensed: ArrayLike | None = None, start: Estimate | None = None) -> Estimate:
        """measured (m, 3) mm places of the markers now, NaN for what is missing; sensed (n_a,) mm of the actuators,
        None without sensors; start: the last estimate. Never raises for what the numbers are."""
        measured = np.asarray(measured, float)
        if measured.shape != self.markers.shape:
            raise InputError(f"expected {len(self.markers)} markers of three numbers, got {measured.shape}")
        scale = np.concatenate([np.abs(self.model.reach).max(axis=1), np.full(len(self.loaded), self.largest)])
        x = self._middle() if start is None else np.concatenate([start.delta_a, start.loads])
        there = np.isfinite(measured).all(axis=1)
        status, damping, iteration = EstimateStatus.ITERATIONS, 1e-3, 0
        r, J, weight = self._residuals(x, measured, there, sensed, np.inf)
        if len(r) < len(x):
            status = EstimateStatus.TOO_FEW
        # far from the answer everything is an outlier: the bound comes down to OUTLIER as the fit gets better
        bound = np.inf
        while status is EstimateStatus.ITERATIONS and iteration < ITERATIONS:
            iteration += 1
            scaled = J * scale
            normal = scaled.T @ scaled
            step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal) + 1e-12), scaled.T @ r)
            trial = x + scale * step
            r_new, J_new, weight_new = self._residuals(trial, measured, there, sensed, bound)
            if not r_new @ r_new <= r @ r * (1 + 1e-12):
                damping *= 10
                if damping < 1e8:
                    continue
            done = np.abs(step).max() <= TOLERANCE or damping >= 1e8
            x, r, J, weight, damping = trial, r_new, J_new, weight_new, max(damping / 10, 1e-12)
            if done and bound == OUTLIER:
                status = EstimateStatus.CONVERGED
            elif done or np.abs(step).max() <= 1e-3:
                bound = OUTLIER if bound <= 4 * OUTLIER else min(bound / 2, self._spread(x, measured, there))
                bound = max(bound, OUTLIER)
                damping = 1e-3
                r, J, weight = self._residuals(x, measured, there, sensed, bound)
        kept = there & (weight > 0.5)
        if status is EstimateStatus.CONVERGED:  # the markers that fit, each in full: so that the covariance is theirs
            for _ in range(POLISH):
                r, J, _ = self._residuals(x, measured, kept, sensed, np.inf)
                x = x - np.linalg.lstsq(J * scale, r, rcond=1e-12)[0] * scale
            r, J, _ = self._residuals(x, measured, kept, sensed, np.inf)
        return self._answer(status, x, J, r, scale, there, kept, iteration)

    def _answer(
        self,
        status: EstimateStatus,
        x: np.ndarray,
        J: np.ndarray,
        r: np.ndarray,
        scale: np.ndarray,
        there: np.ndarray,
        kept: np.ndarray,
        iteration: int,
    ) -> Estimate:
        scaled = J * scale
        covariance = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12) * np.outer(scale, scale)
        names = self.model.rows.actuators + self.loaded
        weak = np.sqrt(np.diag(covariance)) > UNSEEN * scale
        weak |= np.linalg.norm(scaled, axis=0) < 1.0  # nothing moves with it
        s, by_x = self._rows(x)
        n_a, marker = self.model.rows.n_a, r[: 3 * int(kept.sum())]
        return Estimate(
            status,
            x[:n_a],
            x[n_a:],
            covariance,
            s,
            by_x @ covariance @ by_x.T,
            self._effectors(x),
            tuple(int(number) for number in np.flatnonzero(there & ~kept)),
            tuple(name for name, one in zip(names, weak, strict=True) if one),
            float(np.sqrt(np.mean(marker**2))) if len(marker) else 0.0,
            iteration,
        )

    def _middle(self) -> np.ndarray:
        states = self.model.domain.states[:, : self.model.rows.n_a]
        inner = np.linalg.norm(states - states.mean(axis=0), axis=1).argmin()
        return np.concatenate([states[inner], np.zeros(len(self.loaded))])

    def _compliance(self, delta_a: np.ndarray) -> np.ndarray:
        """(n_e + k, n_w) mm/N of effectors and modes to the loads."""
        model, none = self.model, np.zeros(0)
        C_es, C_ss = model.skin.compliance(delta_a, none)
        here, rows = model.at_displacement(delta_a), model.rows
        G = here.effector_jacobian
        C_ee = here.W[rows.e, rows.e] - G @ here.W_aa @ G.T
        return np.block([[C_ee, C_es], [C_es.T, C_ss]]) @ self._picked

    def _rows(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(k,) mm of the skin, and their derivative (k, n_a + n_w)."""
        n_a, n_e, none = self.model.rows.n_a, self.model.rows.n_e, np.zeros(0)
        delta_a, w = x[:n_a], x[n_a:]
        by_a = self.model.skin.gradient(delta_a, none)
        s = self.model.skin.rows(delta_a, none)
        if not len(w):
            return s, by_a
        C = self._compliance(delta_a)[n_e:]
        if w.any():
            for axis in range(n_a):
                h = STEP * float(np.abs(self.model.reach[axis]).max())
                step = h * np.eye(n_a)[axis]
                ahead, behind = (self._compliance(delta_a + sign * step)[n_e:] for sign in (1, -1))
                by_a[:, axis] += (ahead - behind) @ w / (2 * h)
        return s + C @ w, np.hstack([by_a, C])

    def _effectors(self, x: np.ndarray) -> np.ndarray:
        n_a, n_e = self.model.rows.n_a, self.model.rows.n_e
        free = self.model.at_displacement(x[:n_a]).delta_e
        return free + (self._compliance(x[:n_a])[:n_e] @ x[n_a:] if len(self.loaded) else 0.0)

    def _missing(self, x: np.ndarray, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m, 3) over the noise, and its derivative (m, 3, n)."""
        s, by_x = self._rows(x)
        rest = self._nearest[0] @ self.model.skin.rest
        return (rest + self._phi @ s - measured) / self.noise, self._phi @ by_x / self.noise

    def _spread(self, x: np.ndarray, measured: np.ndarray, there: np.ndarray) -> float:
        """Standard deviations, by the median of all markers: robust."""
        missing = np.linalg.norm(self._missing(x, measured)[0][there], axis=1)
        return float(3.0 * np.median(missing)) if len(missing) else OUTLIER

    def _residuals(
        self, x: np.ndarray, measured: np.ndarray, there: np.ndarray, sensed: ArrayLike | None, bound: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """All residuals, their derivative, and the weight (m,) of each marker."""
        missing, J = self._missing(x, measured)
        weight = np.zeros(len(measured))
        size = np.linalg.norm(missing[there], axis=1) / np.sqrt(3)
        weight[there] = 1.0 if np.isinf(bound) else 1.0 / (1.0 + (size / bound) ** 2) ** 2
        root = np.sqrt(weight[there])[:, None]
        r = [(root * missing[there]).ravel()]
        slopes = [(root[..., None] * J[there]).reshape(-1, len(x))]
        n_a = self.model.rows.n_a
        r.append(x[n_a:] / self.largest)
        slopes.append(np.eye(len(x))[n_a:] / self.largest)
        if sensed is not None:
            r.append((x[:n_a] - np.asarray(sensed, float)) / self.sensor)
            slopes.append(np.eye(len(x))[:n_a] / self.sensor)
        return np.concatenate(r), np.vstack(slopes), weight
