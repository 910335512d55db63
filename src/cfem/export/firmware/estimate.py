"""The estimator in C: cfem_estimate.c, the same for every robot, its numbers, cfem_estimate_data.c, and its test."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from cfem.condensed.parameter_values import vector
from cfem.core.artefact.files import write_whole
from cfem.core.errors import InputError
from cfem.export.firmware import c_text
from cfem.export.firmware.copying import copy_sources
from cfem.export.spec import CEstimateSpec, CSpec
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
    said = c_text.comment(f"Markers {names}; unknown {' '.join(made.estimator.unknowns)}: by cfem export.")
    alone = {name: value for name, value in constants.items() if isinstance(value, float)}
    words = sizes | {f"cfem_estimate_{name}": value for name, value in alone.items()}
    arrays = {name: values for name, values in constants.items() if name not in alone}
    c_text.write_constants(folder / "cfem_estimate_data", said, words, "cfem_estimate_", arrays)
    write_frames(folder, "estimate", moving_frames(made), made.estimator.unknowns, TOLERANCE)
    return made


def estimate_constants(made: Filter) -> tuple[dict[str, int], dict[str, np.ndarray | float]]:
    """Sizes, and numbers by name: parameters and scales of the robot are folded in."""
    one = made.estimator
    model, skin, rows = one.model, one.model.skin, one.model.rows
    n_a, n_w, n_e, m, k = rows.n_a, len(one.loaded), rows.n_e, len(one.markers), len(skin)
    arrays, (q, softer), loaded = model.arrays, one.material, one.loaded_rows
    if not all(np.array_equal(arrays[name], skin.arrays[name]) for name in ("to_box", "offset")):
        raise InputError("the skin and the model are not of the same training", do="train it again")
    own = skin.arrays
    soft = [softer * own["compliance"][column] for column in compliance_columns(k, n_e, loaded)]
    across = joined([(own["indices"], own["series"]), *((own["compliance_indices"], one) for one in soft)])
    effectors = [displacement_series(model, row) for row in range(n_e)]
    effectors += [_times(softer, compliance_series(model, e, int(row))) for row in loaded for e in range(n_e)]
    ends = joined(effectors)
    force_indices, force, _ = potential_series(model, loaded)
    force = force * np.concatenate([[1 / softer], np.ones(n_w), np.full(len(force) - 1 - n_w, softer)])[:, None]
    moved = [one.marker_map @ part for part in soft] or [np.zeros((3 * m, len(own["compliance_indices"])))]
    series = {  # by term first
        "markers": (own["indices"], (one.marker_map @ own["series"]).T, "TERMS", "degrees"),
        "soft": (own["compliance_indices"], np.array(moved).transpose(2, 0, 1), "SOFT_TERMS", "soft_degrees"),
        "modes_series": (across[0], _by_row(across[1]), "MODE_TERMS", "mode_degrees"),
        "effectors": (ends[0], _by_row(ends[1].reshape(1 + n_w, n_e, -1)), "EFFECTOR_TERMS", "effector_degrees"),
        "force": (force_indices, force.T, "FORCE_TERMS", "force_degrees"),
    }
    to_box, offset = arrays["to_box"][:, :n_a], arrays["offset"] + arrays["to_box"][:, n_a:] @ q
    still = ~to_box.any(axis=1)  # coordinates of parameters
    n_z = int((~still).sum())
    sizes = {"NA": n_a, "NW": n_w, "N": n_a + n_w, "NZ": n_z, "NE": n_e, "MARKERS": m, "ROWS": k}
    starts, places = one.starts
    constants: dict[str, np.ndarray | float] = {
        "to_box": to_box[~still],
        "offset": offset[~still],
        "scale": one.scale,
        "box": one.box,
        "rest": one.rest,
        "middle": one.middle[:n_a],
        "load_root": one.before.root[:, n_a:] if n_w else np.zeros((1, 1)),
        "load_covariance": one.load_covariance if n_w else np.zeros((1, 1)),
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
    constants |= {"noise": float(one.noise), "sensor": float(one.sensor), "tension": float(one.tension)}
    constants |= {"keeps": made.keeps, "slip": made.slip, "first": made.offset}
    constants |= {"gate_sigmas": made.gate.sigmas}
    return {f"CFEM_ESTIMATE_{name}": value for name, value in sizes.items()}, constants


def _by_row(series: np.ndarray) -> np.ndarray:
    """(1 + n_w, rows, M) -> (M, rows (1 + n_w)): of each row itself, then by each load."""
    return series.transpose(2, 1, 0).reshape(series.shape[2], -1)


def _standing(
    indices: np.ndarray, values: np.ndarray, z: np.ndarray, still: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """A series by term (M, ...) without the coordinates `still` (n,), which stay at z (n,), and its fewer terms."""
    factors = basis(z[still], indices[:, still]) if still.any() else np.ones(len(indices))
    left, place = np.unique(indices[:, ~still], axis=0, return_inverse=True)
    found = np.zeros((len(left), *values.shape[1:]))
    np.add.at(found, place.ravel(), values * factors.reshape(-1, *[1] * (values.ndim - 1)))
    return left, found


def _times(factor: float, part: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    return part[0], factor * part[1]


def moving_frames(made: Filter, count: int = FRAMES) -> list[dict[str, np.ndarray]]:
    """A robot that moves as the filter assumes, some markers lost or wrong, and what Python estimates: by frame."""
    one, rng, found = made.estimator, np.random.default_rng(0), []
    n_a, m = one.model.rows.n_a, len(one.markers)
    states = one.model.domain.states[:, :n_a]
    u, w = states[len(states) // 2].copy(), np.zeros(len(one.loaded))
    usual = np.linalg.cholesky(one.load_covariance)
    filtered = Filter(one, made.slip, made.ticks, made.offset, made.gate.spec)
    for number in range(count):
        toward = states[(number // 10) % len(states)] - u
        u = u + 0.1 * toward
        w = 0.9 * w + 0.4 * usual @ rng.normal(size=len(w))
        x = np.concatenate([u, w])
        places = one.places(x) + one.noise * rng.normal(size=(m, 3))
        sensed = u + one.sensor * rng.normal(size=n_a)
        forces = one.tensions(x) + one.tension * rng.normal(size=n_a)
        if number % 4 == 1:
            places[rng.integers(m)] += 20.0 * rng.normal(size=3)
        if number % 5 == 2:
            places[rng.integers(m)] = np.nan
        if number % 3 == 0:
            sensed[:], forces[:] = np.nan, np.nan
        command = np.full(n_a, np.nan) if number % 7 == 6 else u
        told = None if np.isnan(command).any() else command
        answer = filtered.tick(places, sensed, told, forces)
        found.append(
            {"place": places, "displacement": sensed, "force": forces, "command": command}
            | {"answer": answer, "x": np.concatenate([answer.delta_a, answer.loads]), "covariance": answer.covariance}
        )
    return found


def status_of(status: EstimateStatus) -> int:
    """Status of the C code, a bit, for one of Python."""
    return {"CONVERGED": 0, "TOO_FEW": 1, "OUTLIERS": 2, "ITERATIONS": 4, "REJECTED": 32}[status.name]


def bits(numbers: tuple[int, ...]) -> int:
    return sum(1 << number for number in numbers)


def write_frames(folder: Path, filter: str, frames: list[dict], unknowns: Sequence[str], tolerance: float) -> None:
    """cfem_<filter>_vectors.h, which frames.h runs through. tolerance: of each unknown's scale."""
    rows, own = [], f"CFEM_{filter.upper()}"
    for one in frames:
        answer = one["answer"]
        frame = ", ".join(numbers(one[name]) for name in ("place", "displacement", "force", "command"))
        values = ", ".join(map(numbers, (one["x"], np.diag(one["covariance"]), answer.delta_e)))
        unseen = bits(tuple(unknowns.index(name) for name in answer.unseen))
        rows.append(f"{{{{{frame}}}, {values}, {bits(answer.outliers)}u, {unseen}u, {status_of(answer.status)}u}}")
    text = (
        "/* Frames of a robot that moves, and what Python estimates: by cfem export. */\n"
        f'#include <math.h>\n\n#include "cfem_{filter}.h"\n\n#define FRAMES {len(rows)}\n'
        f"#define TOLERANCE {tolerance} /* of each unknown's scale */\n#define UNKNOWNS {own}_N\n\n"
        "typedef struct { cfem_frame frame; double x[UNKNOWNS], variance[UNKNOWNS], effector[CFEM_ESTIMATE_NE]; "
        "uint32_t left_out, unseen; unsigned status; } vector;\n\n"
        "static const vector vectors[FRAMES] = {\n" + ",\n".join(rows) + "};\n"
    )
    write_whole(folder / f"cfem_{filter}_vectors.h", text.encode())


def numbers(values: np.ndarray) -> str:
    if values.ndim > 1:
        return "{" + ", ".join(numbers(one) for one in values) + "}"
    return "{" + ", ".join("NAN" if np.isnan(one) else c_text.number(one, "double") for one in values) + "}"
