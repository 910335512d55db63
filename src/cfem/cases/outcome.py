"""A calibrated robot and rig as a file: all that predictions of other cases need."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.cases.fit import CaseFit
from cfem.cases.rig import Rig
from cfem.cases.scatter import Scatter
from cfem.cases.table import Cases
from cfem.core.errors import InputError
from cfem.core.files import write_json

FILE = "calibrated.json"


@dataclass(frozen=True)
class Calibrated:
    """names: of the unknowns, in the order of z; sessions: that were measured; degrees: of Student's t; inflation: of
    the sd that the fit states of itself; given: marks of the cases that it was made from; largest (n_a,) N or MPa: of
    their forces."""

    names: tuple[str, ...]
    z: np.ndarray
    d: np.ndarray
    covariance: np.ndarray
    scatter: Scatter
    inflation: float
    degrees: float
    sessions: tuple[str, ...]
    given: tuple[str, ...] = ()
    largest: tuple[float, ...] = ()


def write_calibrated(path: Path, found: CaseFit, rig: Rig, inflation: float, degrees: float, cases: Cases) -> None:
    data = {
        "unknowns": [one.name for one in rig.unknowns],
        "z": found.z,
        "offsets_mm": found.d,
        "covariance": found.covariance,
        "scatter_mm": found.scatter.fixed,
        "scatter_share": found.scatter.share,
        "inflation": inflation,
        "degrees_of_freedom": degrees,
        "sessions": list(rig.sessions),
        "cases": cases.marks,
        "largest_forces": np.abs(cases.forces).max(axis=0),
    }
    write_json(path, data)


def read_calibrated(path: Path) -> Calibrated:
    """InputError where it cannot be read."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        arrays = (np.array(data[name], float) for name in ("z", "offsets_mm", "covariance"))
        scatter = Scatter(float(data["scatter_mm"]), float(data["scatter_share"]))
        numbers = (float(data["inflation"]), float(data["degrees_of_freedom"]))
        told = (tuple(data[name]) for name in ("sessions", "cases", "largest_forces"))
        return Calibrated(tuple(data["unknowns"]), *arrays, scatter, *numbers, *told)
    except (OSError, ValueError, KeyError, TypeError) as error:
        do = "run cfem calibrate-cases again"
        raise InputError(f"is no calibration by cases of this version: {error}", where=str(path), do=do) from None


def widened(known: Calibrated, rig: Rig) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """z, d and their covariance for a rig that may have more sessions: what was known before of what is of these."""
    before = {(name, None): i for i, name in enumerate(known.names)}
    n_z, k3 = len(known.names), len(rig.d_sd) // rig.blocks if rig.blocks else 0
    place = [before.get((one.name, None)) for one in rig.unknowns]
    blocks = [0] + [1 + list(known.sessions).index(s) if s in known.sessions else None for s in rig.sessions]
    for block in blocks[: rig.blocks]:
        place += [None if block is None else n_z + k3 * block + i for i in range(k3)]
    start = np.concatenate([known.z, known.d])
    sd = np.concatenate([np.ones(len(rig.unknowns)), rig.d_sd])
    u = np.array([0.0 if i is None else start[i] for i in place])
    C = np.diag([s**2 if i is None else 0.0 for i, s in zip(place, sd, strict=True)])
    here = np.array([j for j, i in enumerate(place) if i is not None], dtype=int)
    there = np.array([i for i in place if i is not None], dtype=int)
    C[np.ix_(here, here)] = known.covariance[np.ix_(there, there)]
    n = len(rig.unknowns)
    return u[:n], u[n:], C


def estimates(found: CaseFit, rig: Rig, quantile: float, inflation: float) -> dict[str, dict[str, Any]]:
    """Value, unit and interval of each parameter."""
    deviations = inflation * np.sqrt(np.diag(found.covariance))
    made = {}
    for i, one in enumerate(rig.unknowns):
        low, high = one.bounds
        ends = [one.value(float(np.clip(found.z[i] + s * quantile * deviations[i], low, high))) for s in (-1, 1)]
        made[one.name] = {"value": one.value(found.z[i]), "unit": one.parameter.unit, "interval": sorted(ends)}
    return made


def shown(value: float, unit: str) -> tuple[float, str]:
    """A number and its unit as a person would read them."""
    if unit == "rad":
        return float(np.degrees(value)), "deg"
    if unit == "t/mm^3":
        return value * 1e12, "kg/m^3"
    if unit == "MPa":
        return value * 1e3, "kPa"
    return value, "" if unit == "1" else unit


def sentence(name: str, one: dict[str, Any]) -> str:
    """A parameter with its interval."""
    value, unit = shown(one["value"], one["unit"])
    low, high = (shown(end, one["unit"])[0] for end in one["interval"])
    return f"{name} {value:.4g}{' ' + unit if unit else ''}, 95 % interval [{low:.4g}, {high:.4g}]"
