"""Where the whole robot is, and who pushes it, from a few markers: one nonlinear least-squares problem a tick.

Unknown are the displacements delta_a of the actuators and forces w on chosen rows (effectors, or modes of the skin). A
marker m is a fixed mean of surface nodes, Phi_m of the modes; at a state it stands at

    y_m = X_m + Phi_m s        s = s_0(delta_a) + C_s,loads(delta_a) w

where s_0 and C are the model's (`cfem.predict.series.skin`). Sensors of the actuators, where there are any, measure
delta_a, and load cells their forces, which a push changes (`cfem.predict.estimation.force_series`). The answer
minimises the squares of all residuals, each over its own standard deviation: of markers, of sensors, and of the prior
(Gauss-Newton with Levenberg's damping). A single frame has a prior of the loads' size alone; a filter knows more
(`cfem.predict.estimation.filter`). The covariance is the inverse of J^T J (Bard, *Nonlinear Parameter Estimation*,
1974, chapter 7). Markers that do not fit are left out and named (`cfem.predict.estimation.fit`); missing ones are NaN.
Unknowns that the measurements do not observe are named too."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cfem.core.errors import InputError
from cfem.predict.estimation.answer import Estimate
from cfem.predict.estimation.fit import (
    FitResiduals,
    Function,
    Markers,
    Minimum,
    Prior,
    Search,
    Sensor,
    minimise,
)
from cfem.predict.estimation.force_series import ForceSeries
from cfem.predict.estimation.response import RowResponse
from cfem.predict.estimation.series import ReferenceSeries
from cfem.predict.protocol import Predictor
from cfem.predict.series.modes import ModeSeries

ACROSS = 0.01  # of the largest load: standard deviation of a load across a known direction
BEYOND, MOST = 0.25, 8.0  # of the range that the model was trained on; of the largest load
STARTS = 40  # states among which a first guess is looked for
UNSEEN = 0.3  # relative: an unknown whose standard deviation exceeds this share of its scale is not observed
LEAST = 1e-9  # information on each unknown, over its scale: what nothing measures has a deviation of 3e4 scales


@dataclass(frozen=True)
class Estimator:
    """A robot with markers and sensors, whose state one frame gives.

    markers: (m, 3) mm, places on the surface at rest
    noise: mm, standard deviation of each coordinate of a marker
    loaded: names of the rows with unknown forces, of effectors ('tip.x') or of the skin ('skin.1')
    largest: N, standard deviation of such a force before anything is measured
    sensor: mm, standard deviation of the measured delta_a
    tension: N, standard deviation of the measured forces of the actuators (spectral models alone have these)
    p: (n_p,) values of the model's parameters; those of the reference unless given
    along: (n_w,) direction of the load where it is known
    reference: series shared with estimators of other p; made unless given
    """

    model: Predictor
    markers: np.ndarray
    noise: float
    loaded: tuple[str, ...] = ()
    largest: float = 1.0
    sensor: float = 0.01
    tension: float = 0.01
    p: np.ndarray | None = None
    along: np.ndarray | None = None
    reference: ReferenceSeries | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        """InputError where the model cannot estimate, a deviation is not positive, or a marker is not on the
        surface."""
        if self.model.form != "displacement":
            raise InputError("estimation needs a model of form displacement")
        moved = [parameter.name for parameter in self.model.parameters if parameter.moves_body]
        if moved:
            what = f"the shape of other designs is not known: '{moved[0]}' changes where the surface rests"
            raise InputError(what, do="use a model without it")
        if min(self.noise, self.sensor, self.tension, self.largest) <= 0:
            raise InputError("the noise of markers and sensors and the largest load must be positive")
        if self.along is not None and (len(self.along) != len(self.loaded) or not np.linalg.norm(self.along) > 0):
            raise InputError(f"a direction of {len(self.loaded)} loads needs so many numbers, not all of them 0")
        distance = self.series.nearest[1]
        if distance.max(initial=0.0) > 0.05 * self.model.length:
            place = ", ".join(f"{value:.4g}" for value in self.markers[distance.argmax()])
            what = f"the marker at ({place}) mm is {distance.max():.3g} mm off the surface at rest"
            raise InputError(what, do="give markers at rest, in mm, in the frame of the scene")

    def at(self, p: np.ndarray) -> "Estimator":
        """Estimator of the same markers and sensors on the robot with parameters p (n_p,); cheap, as the series are
        shared."""
        return replace(self, p=np.asarray(p, float), reference=self.series)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names (n_a + n_w,) of the unknowns: actuators, then rows with loads."""
        return self.model.rows.actuators + self.loaded

    @cached_property
    def scale(self) -> np.ndarray:
        """Sizes (n_a + n_w,) mm and N that the unknowns reach."""
        return np.concatenate([np.abs(self.model.reach).max(axis=1), np.full(len(self.loaded), self.largest)])

    @cached_property
    def box(self) -> np.ndarray:
        """Bounds (n_a + n_w, 2) mm and N within which the unknowns are searched for."""
        low, high = self.model.domain.delta_a
        more, most = BEYOND * (high - low), np.full(len(self.loaded), MOST * self.largest)
        return np.stack([np.concatenate([low - more, -most]), np.concatenate([high + more, most])], axis=1)

    @cached_property
    def before(self) -> Prior:
        """Prior of a single frame: a middle state, of which nothing is known, and loads of about `largest`."""
        root = np.zeros((len(self.loaded), len(self.scale)))
        root[:, self.model.rows.n_a :] = np.linalg.inv(np.linalg.cholesky(self.load_covariance))
        return Prior(self.middle, root)

    @cached_property
    def load_covariance(self) -> np.ndarray:
        """Covariance (n_w, n_w) N^2 of the loads before anything is measured."""
        relative = np.eye(len(self.loaded))
        if self.along is not None:
            along = np.asarray(self.along, float) / np.linalg.norm(self.along)
            relative = ACROSS**2 * relative + (1 - ACROSS**2) * np.outer(along, along)
        return self.largest**2 * relative

    @property
    def loaded_rows(self) -> np.ndarray:
        """Numbers (n_w,) of the rows with loads, effectors first, then modes of the skin."""
        return self.series.loaded_rows

    @cached_property
    def series(self) -> ReferenceSeries:
        """Series at the reference values of the parameters."""
        return self.reference or ReferenceSeries(self.model, self.markers, self.loaded)

    @cached_property
    def material(self) -> tuple[np.ndarray, float]:
        """Parameters q (n_q,) in the model's coordinates, and how much softer the robot is than the reference."""
        model = self.model
        if self.p is None or not model.parameters:
            return model.q(None), 1.0
        return model.q(self.p), float(model.softer(self.p))

    @property
    def marker_map(self) -> np.ndarray:
        """Matrix (3 m, k) from modes to displacements of the markers."""
        return self.series.marker_map

    @cached_property
    def marker_series(self) -> ModeSeries:
        """Displacements (3 m,) mm of the markers by delta_a and loads."""
        return self.series.markers.at(*self.material)

    @cached_property
    def mode_series(self) -> ModeSeries:
        """Modes (k,) mm of the skin by delta_a and loads."""
        return self.series.modes.at(*self.material)

    @cached_property
    def tension_series(self) -> ForceSeries:
        """Forces (n_a,) N of the actuators by delta_a and loads. InputError of a model that is not spectral."""
        return self.series.forces.at(*self.material)

    @cached_property
    def rest(self) -> np.ndarray:
        """Places (m, 3) mm of the markers on the robot at rest."""
        return self.seen(self.model.skin.rest)

    @cached_property
    def middle(self) -> np.ndarray:
        """The state (n_a + n_w,) nearest to the mean of the training data, without loads."""
        states = self.model.domain.states[:, : self.model.rows.n_a]
        inner = np.linalg.norm(states - states.mean(axis=0), axis=1).argmin()
        return np.concatenate([states[inner], np.zeros(len(self.loaded))])

    def seen(self, surface: np.ndarray) -> np.ndarray:
        """Places (m, 3) mm of the markers on a surface whose nodes are at (n, 3) mm."""
        return self.series.nearest[0] @ surface

    def places(self, x: np.ndarray) -> np.ndarray:
        """Places (m, 3) mm of the markers where the unknowns are x (n_a + n_w,)."""
        return self.rest + self.marker_series(*self.split(x))[0].reshape(-1, 3)

    def tensions(self, x: np.ndarray) -> np.ndarray:
        """Forces (n_a,) N of the actuators where the unknowns are x (n_a + n_w,)."""
        return self.tension_rows(x)[0]

    def tension_rows(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (n_a,) N of the actuators, and their derivative (n_a, n_a + n_w) by x (n_a + n_w,)."""
        return self.tension_series(*self.split(x))

    def estimate(
        self,
        measured: ArrayLike,
        sensed: ArrayLike | None = None,
        start: Estimate | None = None,
        forces: ArrayLike | None = None,
    ) -> Estimate:
        """The state from one frame. Never raises for what the numbers are.

        measured (m, 3) mm: the markers, NaN for what is missing; sensed (n_a,) mm: the actuators' displacements, None
        without sensors; forces (n_a,) N: theirs, None without load cells; start: the last estimate."""
        x = self.middle if start is None else np.concatenate([start.delta_a, start.loads])
        return self.answer(self.minimum(measured, sensed, forces, self.before, x))

    def minimum(
        self, measured: ArrayLike, sensed: ArrayLike | None, forces: ArrayLike | None, prior: Prior, x: np.ndarray
    ) -> Minimum:
        """The minimum of a frame's residuals with a prior, from a first guess x (n_a + n_w,); frame as in
        `estimate`."""
        moved, seen = self.from_rest(np.asarray(measured, float))

        def residual(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            y, by_x = self.marker_series(*self.split(x))
            return (y.reshape(-1, 3) - moved) / self.noise, by_x.reshape(*moved.shape, -1) / self.noise

        problem = FitResiduals(Markers(residual, seen), prior, self._sensors(sensed, forces))
        return minimise(problem, x, Search(self.scale, self.box), lambda: self._nearest_state(moved, seen, x))

    def from_rest(self, measured: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (m, 3) mm of the markers from their places at rest, and (m,) which of them were seen."""
        if measured.shape != self.markers.shape:
            raise InputError(f"expected {len(self.markers)} markers of three numbers, got {measured.shape}")
        seen = np.isfinite(measured).all(axis=1)
        return np.where(seen[:, None], measured, 0.0) - self.rest, seen

    def _nearest_state(self, moved: np.ndarray, seen: np.ndarray, x: np.ndarray) -> np.ndarray:
        """The state (n_a + n_w,), of x and those of the training data, from which half of the markers are nearest.

        moved (m, 3) mm: measured displacements of the markers from rest; seen (m,): which of them were measured."""
        guess = (self.places(x) - self.rest)[None]
        distances = np.linalg.norm((np.concatenate([guess, self.starts[1]]) - moved)[:, seen], axis=2)
        best = int(np.median(distances, axis=1).argmin())
        return x if best == 0 else np.concatenate([self.starts[0][best - 1], np.zeros(len(self.loaded))])

    @cached_property
    def starts(self) -> tuple[np.ndarray, np.ndarray]:
        """States (k, n_a) mm of the training data, and the markers' displacements (k, m, 3) mm from rest there."""
        states, unloaded = self.model.domain.states[:STARTS, : self.model.rows.n_a], np.zeros(len(self.loaded))
        return states, np.array([self.marker_series(state, unloaded)[0].reshape(-1, 3) for state in states])

    def _sensors(self, sensed: ArrayLike | None, forces: ArrayLike | None) -> tuple[Sensor, ...]:
        """The sensors of the actuators that measured something in this frame."""
        return tuple(
            sensor
            for sensor in (
                self.actuator_sensor(sensed, self._displacement_rows, self.sensor),
                self.actuator_sensor(forces, self.tension_rows, self.tension),
            )
            if sensor is not None
        )

    def actuator_sensor(self, measured: ArrayLike | None, function: Function, sd: float) -> Sensor | None:
        """A sensor of one number an actuator; None where none of measured (n_a,) is finite."""
        if measured is None:
            return None
        numbers, n_a = np.asarray(measured, float), self.model.rows.n_a
        if numbers.shape != (n_a,):
            raise InputError(f"expected {n_a} numbers of the actuators, got {numbers.shape}")
        valid = np.isfinite(numbers)
        return Sensor(function, numbers, sd, valid) if valid.any() else None

    def _displacement_rows(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        n_a = self.model.rows.n_a
        return x[:n_a], np.eye(n_a, len(x))

    def answer(self, minimum: Minimum) -> Estimate:
        """The estimate of the whole robot at a minimum."""
        covariance = minimum.covariance(self.scale, LEAST)
        unseen = np.sqrt(np.diag(covariance)) > UNSEEN * self.scale
        unseen |= np.linalg.norm(minimum.J * self.scale, axis=0) < 1.0  # nothing moves with it
        delta_a, loads = self.split(minimum.x)
        return Estimate(
            minimum.status,
            delta_a,
            loads,
            covariance,
            self.mode_series(delta_a, loads)[0],
            self.effectors(delta_a, loads),
            minimum.outliers,
            tuple(name for name, weak in zip(self.unknowns, unseen, strict=True) if weak),
            minimum.noise,
            minimum.iterations,
            minimum.misfit,
        )

    def split(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacements delta_a (n_a,) mm and loads (n_w,) N of unknowns x (n_a + n_w,)."""
        return x[: self.model.rows.n_a], x[self.model.rows.n_a :]

    def effectors(self, delta_a: np.ndarray, loads: np.ndarray) -> np.ndarray:
        """Displacements (n_e,) mm of the effectors at delta_a (n_a,) mm under loads (n_w,) N."""
        response = self.response(delta_a)
        return response.state.delta_e + (response.locked @ loads if len(loads) else 0.0)

    def response(self, delta_a: np.ndarray) -> RowResponse:
        """The robot's answer to loads at delta_a (n_a,) mm."""
        return RowResponse(self.model, self.model.at_displacement(delta_a, self.p), *self.material, self.loaded_rows)
