"""A calibrated robot and rig as a file: all that predictions of other cases need."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import write_json
from cfem.core.errors import InputError
from cfem.identify.cases.discrepancy import DiscrepancyPrior
from cfem.identify.cases.fit import CaseFit
from cfem.identify.cases.rig import Rig
from cfem.identify.cases.scatter import Scatter
from cfem.identify.cases.table import Cases

FILE = "calibrated.json"


@dataclass(frozen=True)
class Calibrated:
    """A calibrated robot and rig.

    names:      of the unknowns, in the order of z
    z, d:       (n_z,) unknowns; (n_d,) mm of the markers
    covariance: (n, n) of z and d
    scatter:    that no unknown explains
    inflation:  of the sd that the fit states of itself
    degrees:    of Student's t
    sessions:   that were measured
    blocks:     kind and name of each block of d
    discrepancy: prior of what the model lacks, None where nothing
    given:      marks of the cases that it was made from
    largest:    (n_a,) N or MPa, of their forces"""

    names: tuple[str, ...]
    z: np.ndarray
    d: np.ndarray
    covariance: np.ndarray
    scatter: Scatter
    inflation: float
    degrees: float
    sessions: tuple[str, ...]
    blocks: tuple[tuple[str, str], ...] = ()
    discrepancy: DiscrepancyPrior | None = None
    given: tuple[str, ...] = ()
    largest: tuple[float, ...] = ()


def write_calibrated(path: Path, fitted: CaseFit, rig: Rig, inflation: float, degrees: float, cases: Cases) -> None:
    """Writes what `read_calibrated` reads; cases: that the fit was made from."""
    data = {
        "unknowns": [unknown.name for unknown in rig.unknowns],
        "z": fitted.z,
        "d_mm": fitted.d,
        "covariance": fitted.covariance,
        "scatter_mm": fitted.scatter.fixed,
        "scatter_share": fitted.scatter.share,
        "inflation": inflation,
        "degrees_of_freedom": degrees,
        "sessions": list(rig.sessions),
        "blocks": rig.blocks,
        "discrepancy": None if rig.discrepancy is None else vars(rig.discrepancy),
        "cases": cases.marks,
        "largest_forces": np.abs(cases.forces).max(axis=0),
    }
    write_json(path, data)


def read_calibrated(path: Path) -> Calibrated:
    """The calibration in a file. InputError where it cannot be read."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        z, d, covariance = (np.array(data[name], float) for name in ("z", "d_mm", "covariance"))
        return Calibrated(
            names=tuple(data["unknowns"]),
            z=z,
            d=d,
            covariance=covariance,
            scatter=Scatter(float(data["scatter_mm"]), float(data["scatter_share"])),
            inflation=float(data["inflation"]),
            degrees=float(data["degrees_of_freedom"]),
            sessions=tuple(data["sessions"]),
            blocks=tuple((kind, name) for kind, name in data["blocks"]),
            discrepancy=_discrepancy(data["discrepancy"]),
            given=tuple(data["cases"]),
            largest=tuple(data["largest_forces"]),
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        do = "run cfem calibrate-cases again"
        raise InputError(f"is no calibration by cases of this version: {error}", where=str(path), do=do) from None


def _discrepancy(data: dict | None) -> DiscrepancyPrior | None:
    if data is None:
        return None
    return DiscrepancyPrior(np.array(data["largest"], float), np.array(data["spread"], float), float(data["share"]))


def widened(known: Calibrated, rig: Rig) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values z, d and their covariance for a rig that may have more sessions; of unknowns of new sessions, what was
    known before any measurement."""
    n_z, n_new = len(known.names), len(rig.unknowns)
    size = len(rig.d_sd) // max(len(rig.blocks), 1)  # of a block
    numbers = {name: i for i, name in enumerate(known.names)}
    places = [numbers.get(unknown.name) for unknown in rig.unknowns]
    starts = {block: n_z + size * i for i, block in enumerate(known.blocks)}
    for block in rig.blocks:
        places += [starts[block] + i if block in starts else None for i in range(size)]
    kept = np.array([j for j, place in enumerate(places) if place is not None], dtype=int)
    source = np.array([place for place in places if place is not None], dtype=int)
    u = np.zeros(len(places))
    u[kept] = np.concatenate([known.z, known.d])[source]
    variance = np.concatenate([np.ones(n_new), rig.d_sd]) ** 2
    variance[kept] = 0.0
    C = np.diag(variance)
    C[np.ix_(kept, kept)] = known.covariance[np.ix_(source, source)]
    return u[:n_new], u[n_new:], C
