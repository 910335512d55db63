"""A rig whose markers are linear in all unknowns: calibrations cost nothing, so that hundreds tell how often intervals
hold."""

import copy
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from cfem.identify.cases.average import average_of, averaged
from cfem.identify.cases.discrepancy import DiscrepancyPrior, discrepancy_of
from cfem.identify.cases.fit import fit_with_discrepancy
from cfem.identify.cases.left_out import leave_one_out
from cfem.identify.cases.outcome import Calibrated
from cfem.identify.cases.prediction.predict import predict
from cfem.identify.cases.rig import MarkerPredictions
from cfem.identify.cases.scatter import Scatter
from cfem.identify.cases.table import Cases

K, N_Z, PRIOR = 4, 5, 4  # markers, parameters, of which so many have a prior


@dataclass(frozen=True)
class Unknown:
    name: str
    known: bool
    session: None = None
    bounds: tuple[float, float] = (-50.0, 50.0)


class LinearRig:
    """slopes: (3 k, n_z) of each force, polynomial in it; d: an offset each marker and axis."""

    def __init__(self, rng: np.random.Generator, offset_sd: float):
        self.unknowns = tuple(Unknown(f"p{i}", i < PRIOR) for i in range(N_Z))
        self._offset_sd, self.sessions, self.discrepancy = offset_sd, ("",), None
        self._first, self._second = rng.standard_normal((2, K, 3, N_Z))
        self.robots = SimpleNamespace(solves=0)

    @property
    def blocks(self) -> list[tuple[str, str]]:
        offsets = [("offset", "all")] if self._offset_sd else []
        return offsets + [("force", str(term)) for term in (self.discrepancy.terms if self.discrepancy else ())]

    @property
    def d_sd(self) -> np.ndarray:
        offsets = np.full(3 * K * bool(self._offset_sd), self._offset_sd)
        lacking = [np.repeat(self.discrepancy.sd, 3)] * len(self.discrepancy.terms) if self.discrepancy else []
        return np.concatenate([offsets, *lacking])

    @property
    def n_d(self) -> int:
        return len(self.d_sd)

    def with_discrepancy(self, discrepancy: DiscrepancyPrior):
        other = copy.copy(self)
        other.discrepancy = discrepancy
        return other

    def see(self, cases: Cases, z: np.ndarray, d: np.ndarray, slopes: bool = True) -> MarkerPredictions:
        f = cases.forces[:, 0][:, None, None, None]
        by_z = 4 * (f * self._first + f**2 * self._second)
        features = self.discrepancy.features(cases.forces) if self.discrepancy else np.zeros((len(cases), 0))
        weights = np.hstack([np.ones((len(cases), int(self._offset_sd > 0))), features])
        by_d = np.einsum("mb,kin->mkibn", weights, np.eye(3 * K).reshape(K, 3, 3 * K)).reshape(len(cases), K, 3, -1)
        moved = np.linalg.norm(by_z @ z, axis=2)
        return MarkerPredictions(by_z @ z + by_d @ d, by_z, by_d, (None,) * len(cases), moved)


def cases_of(forces: np.ndarray, places: np.ndarray) -> Cases:
    m = len(forces)
    names = tuple(f"c{i}" for i in range(m))
    return Cases(names, ("",) * m, forces[:, None], np.ones(m), places, None)


def disturbed(rng: np.random.Generator, m: int, f: np.ndarray, moved: np.ndarray, sort: "Sort") -> np.ndarray:
    """(len(f), K, 3) mm what no unknown explains: noise of each coordinate, and of each case one pattern that the model
    lacks, which grows with the load. m: cases that are given, by which the growing noise is measured."""
    shape = rng.standard_normal((len(f), 2)) @ rng.standard_normal((2, 3 * K))
    grows = rng.uniform() if sort.grows is None else sort.grows
    sd = sort.noise * np.sqrt(1 - grows + grows * moved**2 / np.mean(moved[:m] ** 2))[..., None]
    first, second, bend = rng.standard_normal((3, K, 3)) if sort.smooth else np.zeros((3, K, 3))
    x = f[:, None, None]
    smooth = sort.smooth * (first * x + second * x**2 + 0.5 * bend * np.sin(3 * x))
    return sd * rng.standard_normal((len(f), K, 3)) + sort.lacks * x * shape.reshape(-1, K, 3) + smooth


@dataclass(frozen=True)
class Sort:
    """Of calibration.

    lacks:  what the model lacks, one pattern a case, as a multiple of the noise
    smooth: the same, of what is a smooth function of the force
    discrepancy: whether the calibration estimates it
    models: above 1 that of so many, each of some of the parameters, which predicts left-out cases best
    average: whether all of them are averaged instead
    grows:  w of the noise (scatter.py), None for any
    given, asked: ranges of the forces"""

    lacks: float = 0.0
    offset_sd: float = 0.0
    models: int = 1
    noise: float = 1.0
    grows: float | None = 0.0
    given: tuple[float, float] = (0.3, 1.0)
    asked: tuple[float, float] = (0.3, 1.0)
    smooth: float = 0.0
    discrepancy: bool = False
    average: bool = False


class Part:
    """A rig that knows some of the parameters only."""

    def __init__(self, whole: LinearRig, columns: list[int]):
        self._whole, self._columns = whole, columns
        self.unknowns = tuple(whole.unknowns[i] for i in columns)

    def __getattr__(self, name: str):
        return getattr(self._whole, name)

    def with_discrepancy(self, discrepancy: DiscrepancyPrior):
        return Part(self._whole.with_discrepancy(discrepancy), self._columns)

    def see(self, cases: Cases, z: np.ndarray, d: np.ndarray, slopes: bool = True) -> MarkerPredictions:
        every = np.zeros(len(self._whole.unknowns))
        every[self._columns] = z
        seen = self._whole.see(cases, every, d, slopes)
        return MarkerPredictions(seen.y, seen.by_z[..., self._columns], seen.by_d, seen.poses, seen.moved)


def trial(rng: np.random.Generator, m: int, sort: Sort, new: int = 6):
    """One calibration by m cases, as cfem calibrate-cases does it, and the prediction of new ones."""
    rig = LinearRig(rng, sort.offset_sd)
    z, d = rng.standard_normal(N_Z), rng.standard_normal(rig.n_d) * rig.d_sd
    f = np.concatenate([np.linspace(*sort.given, m), rng.uniform(*sort.asked, new)])
    truth = rig.see(cases_of(f, np.zeros((m + new, K, 3))), z, d)
    measured = cases_of(f, truth.y + disturbed(rng, m, f, truth.moved, sort))
    given, asked = measured.only(np.arange(m)), measured.only(np.arange(m, m + new))
    fitted = []
    for _ in range(sort.models):
        columns = sorted(rng.choice(N_Z, rng.integers(1, N_Z), replace=False)) if sort.models > 1 else list(range(N_Z))
        known_rig = rig.with_discrepancy(discrepancy_of(given)) if sort.discrepancy else rig
        part, found = fit_with_discrepancy(Part(known_rig, [int(i) for i in columns]), given, Scatter(sort.noise))
        fitted.append((part, found, leave_one_out(part, given, found)))
    if not sort.average:
        return predicted(*min(fitted, key=lambda model: model[2].distance.mean()), asked)
    average, _ = average_of([left for *_, left in fitted], [found.count - found.free for _, found, _ in fitted])
    return averaged([predicted(*model, asked) for model in fitted], average, 0.95)


def predicted(part, found, left, asked: Cases):
    """What one fitted model says of other cases."""
    degrees = left.degrees(found.count - found.free)
    names = tuple(unknown.name for unknown in part.unknowns)
    fit = (found.z, found.d, found.covariance, found.scatter)
    known = Calibrated(names, *fit, left.inflation, degrees, part.sessions, tuple(part.blocks))
    return predict(part, asked, known, 0.95)


def coverage(trials: int, m: int, sort: Sort) -> tuple[float, float]:
    """Share of coordinates within their 95 % intervals and of markers within their 95 % radius, over all trials."""
    rngs = (np.random.default_rng([seed, m]) for seed in range(trials))
    found = [trial(rng, m, sort).covered() for rng in rngs]
    return tuple(float(share) for share in np.mean(found, axis=0))
