"""The estimator in C: cfem_estimate.c, the same for every robot, its numbers, cfem_estimate_data.c, and its test."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.condensed.parameters import vector
from cfem.core.artefact.files import write_whole
from cfem.core.errors import InputError
from cfem.export.firmware import c_text
from cfem.export.firmware.copying import copy_sources
from cfem.export.spec import CEstimateSpec, CSpec
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import Filter, filter_of
from cfem.predict.estimation.fit import EstimateStatus
from cfem.predict.estimation.force_series import compliance_series, displacement_series, potential_series
from cfem.predict.protocol import Predictor
from cfem.predict.series.chebyshev import basis
from cfem.predict.series.modes import compliance_columns, joined

SHARED = tuple(f"controller/{name}" for name in ("cost.h", "cfem_chebyshev.h", "cfem_gate.h", "cfem_linear.h"))
MOST = 32  # markers, and unknowns: bits of a status
FRAMES = 60  # of the test
TOLERANCE = 1e-8  # of each unknown's scale


def firmware_filter(spec: CEstimateSpec, model: Predictor, p: np.ndarray | None) -> Filter:
    """Filter that the C code computes. InputError for a model that has no estimator in C."""
    if model.meta["kind"] != "spectral" or model.form != "displacement":
        raise InputError("only spectral models of form displacement estimate in C", do="train kind: spectral")
    made = filter_of(spec, model, spec.rate, p=p)
    if max(len(spec.markers), len(made.estimator.unknowns)) > MOST:
        raise InputError(f"the estimator in C has at most {MOST} markers and unknowns", where="c.estimate")
    return made


def write_c_estimate(folder: Path, model: Predictor, spec: CSpec) -> Filter:
    """Adds the estimator of `spec.estimate` to a C folder; what it is in Python."""
    p = vector(model.parameters, spec.parameters, "c.parameters") if model.parameters else None
    made = firmware_filter(spec.estimate, model, p)
    copy_sources(folder, "estimate", *SHARED)
    sizes, constants = estimate_constants(made)
    names = " ".join(spec.estimate.markers)
    heading = c_text.comment(f"Markers {names}; unknown {' '.join(made.estimator.unknowns)}: by cfem export.")
    alone = {name: value for name, value in constants.items() if isinstance(value, float)}
    words = sizes | {f"cfem_estimate_{name}": value for name, value in alone.items()}
    arrays = {name: values for name, values in constants.items() if name not in alone}
    c_text.write_constants(folder / "cfem_estimate_data", heading, words, "cfem_estimate_", arrays)
    write_frames(folder, "estimate", moving_frames(made), made.estimator.unknowns, TOLERANCE)
    return made


def estimate_constants(made: Filter) -> tuple[dict[str, int], dict[str, np.ndarray | float]]:
    """Sizes, and numbers by name: parameters and scales of the robot are folded in."""
    estimator = made.estimator
    model, skin, rows = estimator.model, estimator.model.skin, estimator.model.rows
    n_a, n_w, n_e, m, k = rows.n_a, len(estimator.loaded), rows.n_e, len(estimator.markers), len(skin)
    arrays, (q, _) = model.arrays, estimator.material
    if not all(np.array_equal(arrays[name], skin.arrays[name]) for name in ("to_box", "offset")):
        raise InputError("the skin and the model are not of the same training", do="train it again")
    series = _series(estimator)
    to_box, offset = arrays["to_box"][:, :n_a], arrays["offset"] + arrays["to_box"][:, n_a:] @ q
    still = ~to_box.any(axis=1)  # coordinates of parameters
    n_z = int((~still).sum())
    sizes = {"NA": n_a, "NW": n_w, "N": n_a + n_w, "NZ": n_z, "NE": n_e, "MARKERS": m, "ROWS": k}
    starts, places = estimator.starts
    constants: dict[str, np.ndarray | float] = {
        "to_box": to_box[~still],
        "offset": offset[~still],
        "scale": estimator.scale,
        "box": estimator.box,
        "rest": estimator.rest,
        "middle": estimator.middle[:n_a],
        "load_root": estimator.before.root[:, n_a:] if n_w else np.zeros((1, 1)),
        "load_covariance": estimator.load_covariance if n_w else np.zeros((1, 1)),
        "starts": starts,
        "start_places": places.reshape(len(starts), -1),
    }
    degree = 1
    for name, (indices, values, terms, degrees) in series.items():
        indices, values = _standing(indices, values, offset, still)
        kept = np.flatnonzero(values.reshape(len(values), -1).any(axis=1))
        kept = kept if len(kept) else np.zeros(1, dtype=int)
        constants[name] = np.ascontiguousarray(values[kept], dtype=float)
        constants[degrees] = indices[kept].astype(np.uint8)
        sizes[terms] = len(kept)
        degree = max(degree, int(indices[kept].max(initial=0)))
    sizes |= {"DEGREE": degree, "STARTS": len(starts), "GATE_SAMPLES": made.gate.samples}
    constants |= {
        "noise": float(estimator.noise),
        "sensor": float(estimator.sensor),
        "tension": float(estimator.tension),
    }
    constants |= {"keeps": made.keeps, "slip": made.slip, "first": made.offset}
    constants |= {"gate_sigmas": made.gate.sigmas}
    return {f"CFEM_ESTIMATE_{name}": value for name, value in sizes.items()}, constants


def _series(estimator: Estimator) -> dict[str, tuple[np.ndarray, np.ndarray, str, str]]:
    """Series by name: indices of the terms, coefficients by term, names of their number and of their degrees: of the
    markers, of what loads change there (`soft`), and of modes, effectors and forces with what loads change."""
    model, (_, softer), loaded = estimator.model, estimator.material, estimator.loaded_rows
    n_w, n_e = len(estimator.loaded), model.rows.n_e
    skin_arrays = model.skin.arrays
    soft = [softer * skin_arrays["compliance"][column] for column in compliance_columns(len(model.skin), n_e, loaded)]
    across = joined(
        [
            (skin_arrays["indices"], skin_arrays["series"]),
            *((skin_arrays["compliance_indices"], coefficients) for coefficients in soft),
        ]
    )
    effectors = [displacement_series(model, row) for row in range(n_e)]
    effectors += [_times(softer, compliance_series(model, e, int(row))) for row in loaded for e in range(n_e)]
    ends = joined(effectors)
    force_indices, force, _ = potential_series(model, loaded)
    force = force * np.concatenate([[1 / softer], np.ones(n_w), np.full(len(force) - 1 - n_w, softer)])[:, None]
    moved = [estimator.marker_map @ coefficients for coefficients in soft]
    moved = moved or [np.zeros((3 * len(estimator.markers), len(skin_arrays["compliance_indices"])))]
    return {
        "markers": (skin_arrays["indices"], (estimator.marker_map @ skin_arrays["series"]).T, "TERMS", "degrees"),
        "soft": (skin_arrays["compliance_indices"], np.array(moved).transpose(2, 0, 1), "SOFT_TERMS", "soft_degrees"),
        "modes_series": (across[0], _by_row(across[1]), "MODE_TERMS", "mode_degrees"),
        "effectors": (ends[0], _by_row(ends[1].reshape(1 + n_w, n_e, -1)), "EFFECTOR_TERMS", "effector_degrees"),
        "force": (force_indices, force.T, "FORCE_TERMS", "force_degrees"),
    }


def _by_row(series: np.ndarray) -> np.ndarray:
    """Coefficients (M, rows (1 + n_w)) from those of (1 + n_w, rows, M): of each row itself, then by each load."""
    return series.transpose(2, 1, 0).reshape(series.shape[2], -1)


def _standing(
    indices: np.ndarray, values: np.ndarray, z: np.ndarray, still: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A series by term (M, ...) without the coordinates `still` (n,), which stay at z (n,), and its fewer terms."""
    factors = basis(z[still], indices[:, still]) if still.any() else np.ones(len(indices))
    left, place = np.unique(indices[:, ~still], axis=0, return_inverse=True)
    summed = np.zeros((len(left), *values.shape[1:]))
    np.add.at(summed, place.ravel(), values * factors.reshape(-1, *[1] * (values.ndim - 1)))
    return left, summed


def _times(factor: float, part: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return part[0], factor * part[1]


def moving_frames(made: Filter) -> list[dict[str, np.ndarray]]:
    """A robot that moves as the filter assumes, some markers lost or wrong, and what Python estimates: by frame."""
    estimator, rng, frames = made.estimator, np.random.default_rng(0), []
    n_a, m = estimator.model.rows.n_a, len(estimator.markers)
    states = estimator.model.domain.states[:, :n_a]
    states = states[states.any(axis=1)]  # rest is farther from the others than the filter takes a robot to go at once
    u, w = states[len(states) // 2].copy(), np.zeros(len(estimator.loaded))
    usual = np.linalg.cholesky(estimator.load_covariance)
    filtered = Filter(estimator, made.slip, made.ticks, made.offset, made.gate.spec)
    for number in range(FRAMES):
        toward = states[(number // 10) % len(states)] - u
        u = u + 0.1 * toward
        w = 0.9 * w + 0.4 * usual @ rng.normal(size=len(w))
        x = np.concatenate([u, w])
        places = estimator.places(x) + estimator.noise * rng.normal(size=(m, 3))
        sensed = u + estimator.sensor * rng.normal(size=n_a)
        forces = estimator.tensions(x) + estimator.tension * rng.normal(size=n_a)
        if number % 4 == 1:
            places[rng.integers(m)] += 20.0 * rng.normal(size=3)
        if number % 5 == 2:
            places[rng.integers(m)] = np.nan
        if number % 3 == 0:
            sensed[:], forces[:] = np.nan, np.nan
        command = np.full(n_a, np.nan) if number % 7 == 6 else u
        given = None if np.isnan(command).any() else command
        answer = filtered.tick(places, sensed, given, forces)
        frames.append(
            {"place": places, "displacement": sensed, "force": forces, "command": command}
            | {"answer": answer, "x": np.concatenate([answer.delta_a, answer.loads]), "covariance": answer.covariance}
        )
    return frames


def status_of(status: EstimateStatus) -> int:
    """Status of the C code, a bit, for one of Python."""
    return {"CONVERGED": 0, "TOO_FEW": 1, "OUTLIERS": 2, "ITERATIONS": 4, "REJECTED": 32}[status.name]


def bits(numbers: tuple[int, ...]) -> int:
    return sum(1 << number for number in numbers)


def write_frames(folder: Path, filter: str, frames: list[dict], unknowns: Sequence[str], tolerance: float) -> None:
    """cfem_<filter>_vectors.h, which frames.h runs through. tolerance: of each unknown's scale."""
    rows, prefix = [], f"CFEM_{filter.upper()}"
    for frame in frames:
        answer = frame["answer"]
        measured = ", ".join(numbers(frame[name]) for name in ("place", "displacement", "force", "command"))
        values = ", ".join(map(numbers, (frame["x"], np.diag(frame["covariance"]), answer.delta_e)))
        unseen = bits(tuple(unknowns.index(name) for name in answer.unseen))
        rows.append(f"{{{{{measured}}}, {values}, {bits(answer.outliers)}u, {unseen}u, {status_of(answer.status)}u}}")
    text = (
        "/* Frames of a robot that moves, and what Python estimates: by cfem export. */\n"
        f'#include <math.h>\n\n#include "cfem_{filter}.h"\n\n#define FRAMES {len(rows)}\n'
        f"#define TOLERANCE {tolerance} /* of each unknown's scale */\n#define UNKNOWNS {prefix}_N\n\n"
        "typedef struct { cfem_frame frame; double x[UNKNOWNS], variance[UNKNOWNS], effector[CFEM_ESTIMATE_NE]; "
        "uint32_t left_out, unseen; unsigned status; } vector;\n\n"
        "static const vector vectors[FRAMES] = {\n" + ",\n".join(rows) + "};\n"
    )
    write_whole(folder / f"cfem_{filter}_vectors.h", text.encode())


def numbers(values: np.ndarray) -> str:
    if values.ndim > 1:
        return "{" + ", ".join(numbers(row) for row in values) + "}"
    return "{" + ", ".join("NAN" if np.isnan(value) else c_text.number(value, "double") for value in values) + "}"
