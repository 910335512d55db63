"""Where the whole robot is, and who pushes it, from a few markers: one nonlinear least-squares problem a tick.

Unknown are the displacements delta_a of the actuators and forces w on chosen rows (effectors, or modes of the skin). A
marker m is a fixed mean of surface nodes, Phi_m of the modes; at a state it stands at

    y_m = X_m + Phi_m s        s = s_0(delta_a) + C_s,loads(delta_a) w

where s_0 and C are the model's (`cfem.predict.skin`). Sensors of the actuators, where there are any, measure delta_a,
and load cells their forces, which a push changes (`cfem.predict.force_series`).
The answer minimises the squares of what is missing, each over its own standard deviation: markers, sensors, and what is
known before (Gauss-Newton with Levenberg's damping). Without more, that is about how large the loads are at most; a
filter knows more (`cfem.predict.estimate_filter`). The covariance is the inverse of J^T J (Bard, *Nonlinear Parameter
Estimation*, 1974, chapter 7). Markers that do not fit are left out and named (`cfem.predict.estimate_fit`); missing
ones are NaN. Unknowns that the measurements do not tell are named too."""

import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError
from cfem.predict.estimate_answer import Estimate
from cfem.predict.estimate_fit import Known, Minimum, Residuals, Sensor, minimise
from cfem.predict.force_series import ForceSeries
from cfem.predict.load_response import LoadResponse
from cfem.predict.markers import on_triangles
from cfem.predict.mode_series import ModeSeries
from cfem.predict.protocol import Predictor
from cfem.predict.spectral import SpectralPredictor

ACROSS = 0.01  # of the largest load: what acts across a known direction
BEYOND, MOST = 0.25, 8.0  # of the range that the model was trained on; of the largest load
STARTS = 40  # states among which a first guess is looked for
UNSEEN = 0.3  # relative: an unknown whose standard deviation exceeds this share of its scale is not observed


@dataclass(frozen=True)
class Estimator:
    """markers (m, 3) mm: places on the surface at rest; noise: mm, standard deviation of each of their coordinates;
    loaded: names of rows on which forces are unknown, of effectors ('tip.x') or of the skin ('skin.1'); largest: N,
    standard deviation of such a force before anything is measured; sensor: mm, of the measured delta_a; tension: N, of
    the measured forces of the actuators (a spectral model knows what loads do to them); p (n_p,): values of the model's
    parameters, those of the reference unless given; along (n_w,): direction of the load where it is known."""

    model: Predictor
    markers: np.ndarray
    noise: float
    loaded: tuple[str, ...] = ()
    largest: float = 1.0
    sensor: float = 0.01
    tension: float = 0.01
    p: np.ndarray | None = None
    along: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.model.form != "displacement":
            raise InputError("estimation needs a model of form displacement")
        moved = [one.name for one in self.model.parameters if one.moves_body]
        if moved:
            what = f"the shape of other designs is not known: '{moved[0]}' changes where the surface rests"
            raise InputError(what, do="use a model without it")
        if min(self.noise, self.sensor, self.tension, self.largest) <= 0:
            raise InputError("the noise of markers and sensors and the largest load must be positive")
        if self.along is not None and (len(self.along) != len(self.loaded) or not np.linalg.norm(self.along) > 0):
            raise InputError(f"a direction of {len(self.loaded)} loads needs so many numbers, not all of them 0")
        unknown = [name for name in self.loaded if name not in self._names]
        if unknown:
            raise InputError(f"the model has no row {unknown[0]!r}", do=f"known are {', '.join(self._names)}")
        away = self._nearest[1]
        if away.max(initial=0.0) > 0.05 * self.model.length:
            place = ", ".join(f"{value:.4g}" for value in self.markers[away.argmax()])
            what = f"the marker at ({place}) mm is {away.max():.3g} mm off the surface at rest"
            raise InputError(what, do="give markers at rest, in mm, in the frame of the scene")

    @property
    def _names(self) -> tuple[str, ...]:
        return self.model.rows.effectors + self.model.skin.names

    @property
    def unknowns(self) -> tuple[str, ...]:
        """(n_a + n_w) names: actuators, then rows with loads."""
        return self.model.rows.actuators + self.loaded

    @cached_property
    def scale(self) -> np.ndarray:
        """(n_a + n_w,) mm and N: how large each unknown becomes."""
        return np.concatenate([np.abs(self.model.reach).max(axis=1), np.full(len(self.loaded), self.largest)])

    @cached_property
    def box(self) -> np.ndarray:
        """(n_a + n_w, 2) mm and N: where the unknowns are looked for."""
        low, high = self.model.domain.delta_a
        more, most = BEYOND * (high - low), np.full(len(self.loaded), MOST * self.largest)
        return np.stack([np.concatenate([low - more, -most]), np.concatenate([high + more, most])], axis=1)

    @cached_property
    def before(self) -> Known:
        """What is known before anything is measured: a middle state, and loads of about `largest`."""
        root = np.zeros((len(self.loaded), len(self.scale)))
        root[:, self.model.rows.n_a :] = np.linalg.inv(np.linalg.cholesky(self.load_covariance))
        return Known(self.middle, root)

    @cached_property
    def load_covariance(self) -> np.ndarray:
        """(n_w, n_w) N^2 of the loads before anything is measured."""
        every = np.eye(len(self.loaded))
        if self.along is not None:
            along = np.asarray(self.along, float) / np.linalg.norm(self.along)
            every = ACROSS**2 * every + (1 - ACROSS**2) * np.outer(along, along)
        return self.largest**2 * every

    @cached_property
    def _nearest(self) -> tuple[np.ndarray, np.ndarray]:
        """(m, n) weights of the nodes, those of the nearest triangle; distances (m,) mm."""
        return on_triangles(self.markers, self.model.skin.rest, self.model.skin.triangles)

    @cached_property
    def loaded_rows(self) -> np.ndarray:
        return np.array([self._names.index(name) for name in self.loaded], dtype=int)

    def at(self, p: np.ndarray) -> "Estimator":
        """Of the robot with other values p (n_p,) of the parameters: cheap."""
        found, kept = copy.copy(self), ("scale", "box", "middle", "before")
        shared = {name: getattr(self, name) for name in ("marker_series", "mode_series", *kept)}
        if "tension_series" in vars(self):
            shared["tension_series"] = self.tension_series
        object.__setattr__(found, "p", np.asarray(p, float))
        q, softer = found.material
        moved = {name: one.at(q, softer) if hasattr(one, "at") else one for name, one in shared.items()}
        vars(found).update(moved)
        return found

    @property
    def material(self) -> tuple[np.ndarray, float]:
        """q (n_q,), and how much softer than the reference."""
        model = self.model
        if self.p is None or not model.parameters:
            return model.q(None), 1.0
        return model.q(self.p), float(model.softer(self.p))

    def _series(self, T: np.ndarray) -> ModeSeries:
        rows = self.model.rows
        return ModeSeries(self.model.skin, rows.n_a, T, rows.n_e, self.loaded_rows).at(*self.material)

    @cached_property
    def marker_map(self) -> np.ndarray:
        """(3 m, k) from modes to displacements of the markers."""
        phi = np.einsum("mn,kni->mik", self._nearest[0], self.model.skin.modes)
        return phi.reshape(-1, phi.shape[2])

    @cached_property
    def marker_series(self) -> ModeSeries:
        return self._series(self.marker_map)

    @cached_property
    def mode_series(self) -> ModeSeries:
        return self._series(np.eye(len(self.model.skin)))

    @cached_property
    def tension_series(self) -> ForceSeries:
        if not isinstance(self.model, SpectralPredictor):
            kind = self.model.meta["kind"]
            what = f"actuator forces need a model of kind spectral, got '{kind}'"
            raise InputError(what, do="leave the forces out, or train a spectral model")
        return ForceSeries(self.model, self.loaded_rows).at(*self.material)

    @cached_property
    def rest(self) -> np.ndarray:
        return self.seen(self.model.skin.rest)

    @cached_property
    def middle(self) -> np.ndarray:
        states = self.model.domain.states[:, : self.model.rows.n_a]
        inner = np.linalg.norm(states - states.mean(axis=0), axis=1).argmin()
        return np.concatenate([states[inner], np.zeros(len(self.loaded))])

    def seen(self, surface: np.ndarray) -> np.ndarray:
        """(m, 3) mm the markers on a surface whose nodes are at (n, 3) mm."""
        return self._nearest[0] @ surface

    def places(self, x: np.ndarray) -> np.ndarray:
        """(m, 3) mm the markers where the unknowns are x (n_a + n_w,)."""
        return self.rest + self.marker_series(*self._apart(x))[0].reshape(-1, 3)

    def tensions(self, x: np.ndarray) -> np.ndarray:
        """(n_a,) N forces of the actuators where the unknowns are x (n_a + n_w,)."""
        return self._forces(x)[0]

    def estimate(
        self,
        measured: ArrayLike,
        sensed: ArrayLike | None = None,
        start: Estimate | None = None,
        forces: ArrayLike | None = None,
    ) -> Estimate:
        """measured (m, 3) mm places of the markers now, NaN for what is missing; sensed (n_a,) mm of the actuators,
        None without sensors; forces (n_a,) N of theirs, None without load cells; start: the last estimate. Never raises
        for what the numbers are."""
        x = self.middle if start is None else np.concatenate([start.delta_a, start.loads])
        return self.with_known(measured, sensed, forces, self.before, x)

    def with_known(
        self, measured: ArrayLike, sensed: ArrayLike | None, forces: ArrayLike | None, known: Known, x: np.ndarray
    ) -> Estimate:
        """As `estimate`, from what is known before and a first guess x (n_a + n_w,)."""
        where, there = self.from_rest(np.asarray(measured, float))

        def missing(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            y, by_x = self.marker_series(*self._apart(x))
            return (y.reshape(-1, 3) - where) / self.noise, by_x.reshape(*where.shape, -1) / self.noise

        problem = Residuals(missing, there, known, self._sensors(sensed, forces))
        return self._answer(minimise(problem, x, self.scale, self.box, lambda: self._near(where, there, x)), there)

    def from_rest(self, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(m, 3) mm of the markers from their places at rest, and (m,) which of them were seen."""
        if measured.shape != self.markers.shape:
            raise InputError(f"expected {len(self.markers)} markers of three numbers, got {measured.shape}")
        there = np.isfinite(measured).all(axis=1)
        return np.where(there[:, None], measured, 0.0) - self.rest, there

    def _near(self, where: np.ndarray, there: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Of x and the states that the model was trained on, the one from which half of the markers (m, 3) are least
        away."""
        mine = (self.places(x) - self.rest)[None]
        apart = np.linalg.norm((np.concatenate([mine, self.starts[1]]) - where)[:, there], axis=2)
        best = int(np.median(apart, axis=1).argmin())
        return x if best == 0 else np.concatenate([self.starts[0][best - 1], np.zeros(len(self.loaded))])

    @cached_property
    def starts(self) -> tuple[np.ndarray, np.ndarray]:
        """States (k, n_a) mm of the actuators, and (k, m, 3) mm where the markers are seen then, from rest."""
        states, none = self.model.domain.states[:STARTS, : self.model.rows.n_a], np.zeros(len(self.loaded))
        return states, np.array([self.marker_series(one, none)[0].reshape(-1, 3) for one in states])

    def _sensors(self, sensed: ArrayLike | None, forces: ArrayLike | None) -> tuple[Sensor, ...]:
        """What misses of displacements and forces of the actuators, by x, for those that were measured."""
        found = []
        for given, of, sd in ((sensed, self._identity, self.sensor), (forces, self._forces, self.tension)):
            numbers = None if given is None else np.asarray(given, float)
            if numbers is not None and numbers.shape != (self.model.rows.n_a,):
                raise InputError(f"expected {self.model.rows.n_a} numbers of the actuators, got {numbers.shape}")
            if numbers is not None and np.isfinite(numbers).any():
                found.append(Sensor(of, numbers, sd, np.isfinite(numbers)))
        return tuple(found)

    def _identity(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n_a = self.model.rows.n_a
        return x[:n_a], np.eye(n_a, len(x))

    def _forces(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.tension_series(*self._apart(x))

    def _answer(self, found: Minimum, there: np.ndarray) -> Estimate:
        scaled = found.J * self.scale
        # what nothing tells has a deviation of 3e4 times its scale
        normal = scaled.T @ scaled + 1e-9 * np.eye(len(self.scale))
        covariance = np.linalg.inv(normal) * np.outer(self.scale, self.scale)
        weak = np.sqrt(np.diag(covariance)) > UNSEEN * self.scale
        weak |= np.linalg.norm(scaled, axis=0) < 1.0  # nothing moves with it
        s, _ = self.mode_series(*self._apart(found.x))
        n_a, marker = self.model.rows.n_a, found.r[: 3 * int(found.kept.sum())]
        return Estimate(
            found.status,
            found.x[:n_a],
            found.x[n_a:],
            covariance,
            s,
            self._effectors(found.x),
            tuple(int(number) for number in np.flatnonzero(there & ~found.kept)),
            tuple(name for name, one in zip(self.unknowns, weak, strict=True) if one),
            float(np.sqrt(np.mean(marker**2))) if len(marker) else 0.0,
            found.iterations,
            found.innovation,
        )

    def _apart(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x[: self.model.rows.n_a], x[self.model.rows.n_a :]

    def _effectors(self, x: np.ndarray) -> np.ndarray:
        delta_a, w = self._apart(x)
        at = self.response(delta_a)
        return at.here.delta_e + (at.locked @ w if len(w) else 0.0)

    def response(self, delta_a: np.ndarray) -> LoadResponse:
        """What the loads do at delta_a (n_a,) mm."""
        return LoadResponse(self.model, self.model.at_displacement(delta_a, self.p), *self.material, self.loaded_rows)
