"""The filter of a robot that moves in C: cfem_swing.c, the same for every robot, its numbers and its test.

It shares the steps of predictive control and the least squares of the static estimator, each compiled once more
with the filter's sizes."""

from pathlib import Path

import numpy as np

from cfem.core.artefact.files import disk_errors, write_whole
from cfem.core.errors import InputError, SpecError
from cfem.export.firmware import c_text
from cfem.export.firmware import estimate as c_estimate
from cfem.export.firmware.copying import SOURCES, copy_sources
from cfem.export.spec import CSpec
from cfem.motion.estimation.marker_filter import MarkerFilter
from cfem.motion.estimation.uncertainty import motion_uncertainty
from cfem.motion.model import MotionModel
from cfem.motion.modes import prewarp
from cfem.motion.step import MotionCommand, at_rest, step
from cfem.predict.estimation.filter import Filter

SHARED = ("mpc/cfem_tick.h", "mpc/cfem_mpc_room.h")
TWICE = {  # what is compiled once more, after a header of other sizes
    "cfem_swing_tick.c": ("cfem_swing_room.h", SOURCES / "mpc" / "cfem_tick.c"),
    "cfem_swing_least.c": ("cfem_swing_fit.h", SOURCES / "estimate" / "cfem_estimate_fit.c"),
}
FRAMES = 60  # of the test
TOLERANCE = 1e-7  # of each unknown's scale


def moving_filter_of(still: Filter, spec: CSpec, motion: MotionModel) -> MarkerFilter:
    """Filter of Python that the C code repeats; still: the filter of the same robot at rest. InputError where there is
    no C code."""
    estimate, rows = spec.estimate, still.estimator.loaded_rows
    if spec.scalar != "double":
        raise SpecError(
            "the filter of a moving robot needs double precision", where="c.scalar", do="take `scalar: double`"
        )
    if (rows >= motion.rows.n_e).any():
        what = "the filter of a moving robot in C has loads on effectors only"
        raise InputError(what, where="c.estimate.loads.rows", do="name rows of effectors")
    uncertainty = motion_uncertainty(estimate, still.estimator.model, estimate.rate)
    return MarkerFilter(still.estimator, motion, estimate.dynamics.driven, uncertainty, estimate.gate)


def write_c_swing(folder: Path, still: Filter, spec: CSpec, motion: MotionModel) -> MarkerFilter:
    """Adds the filter to a C folder that holds the estimator, the controller and the step in time; what it is in
    Python."""
    made, rate = moving_filter_of(still, spec, motion), spec.estimate.rate
    copy_sources(folder, "swing", *SHARED)
    with disk_errors(folder):
        for name, (header, source) in TWICE.items():
            text = f'#include "{header}"\n\n' + source.read_text(encoding="utf-8")
            write_whole(folder / name, text.encode())
    sizes, constants = swing_constants(made, rate)
    heading = c_text.comment(f"Markers {' '.join(spec.estimate.markers)} on a robot that moves: by cfem export.")
    words = {f"CFEM_SWING_{name}": value for name, value in sizes.items()}
    file, declared = folder / "cfem_swing_data", '#include "cfem_motion_data.h"\n'
    c_text.write_constants(file, heading, words, "cfem_swing_", constants, declared)
    frames = swinging_frames(made, 1 / rate)
    c_estimate.write_frames(folder, "swing", frames, made.unknowns, TOLERANCE)
    return made


def swing_constants(made: MarkerFilter, rate: float) -> tuple[dict[str, object], dict[str, np.ndarray]]:
    """Sizes and numbers, and arrays, by name."""
    motion, uncertainty, estimator, forward = made.motion, made.uncertainty, made.estimator, made.forward
    n_w, m, k = len(estimator.loaded), len(estimator.markers), len(estimator.model.skin)
    count = forward.count(1 / rate)
    dt = 1 / rate / count
    (indices, of_markers), (_, of_modes) = (series.parts for series in made.markers.inner)  # of the same indices
    sizes = {"N": motion.n_q + n_w + 1, "NZ": forward.n_z, "NX": forward.n_z + n_w + 1, "LOADS": max(n_w, 1)}
    sizes |= {"STEPS": count, "FORCE": int(made.kind == "force"), "TERMS": len(indices)}
    sizes |= {"DEGREE": max(int(indices.max(initial=0)), 1)}
    numbers = {
        "RATE": rate,
        "DT": dt,
        "WARP": prewarp(forward.first, dt),
        "KEEPS": np.exp(-dt / uncertainty.lasts),
        "SLIP": uncertainty.slip,
        "OFFSET": uncertainty.offset,
        "PUSH": uncertainty.push,
        "STIFFNESS": uncertainty.stiffness,
        "WANDER": uncertainty.wander,
        "SWING": made.swing,
        "LENGTH": estimator.model.length,
        "NOISE": estimator.noise,
    }
    constants = {
        "scale": made.scale,
        "box": made.box,
        "jump": made.jump,
        "rows": np.asarray(estimator.loaded_rows if n_w else [0], dtype=np.int32),
        "degrees": indices.astype(np.uint8),
        "markers": np.ascontiguousarray(of_markers[: 3 * m * motion.n_r].T),
        "modes_series": np.ascontiguousarray(of_modes[: k * motion.n_r].T),
    }
    return sizes | {name: repr(float(value)) for name, value in numbers.items()}, constants


def swinging_frames(made: MarkerFilter, period: float, count: int = FRAMES) -> list[dict]:
    """The model's own motion under commands that jump, some markers lost or wrong, an actuator that is not where its
    command is, and what Python estimates: by frame."""
    estimator, motion, frames, rng = made.estimator, made.motion, [], np.random.default_rng(0)
    filtered = MarkerFilter(estimator, motion, made.kind, made.uncertainty, made.gate.spec)
    n_a, m, states = motion.n_a, len(estimator.markers), estimator.model.domain.states[:, : motion.n_a]
    stands = estimator.middle[:n_a]
    now, force = at_rest(motion, stands), made.kind == "force"
    push = np.zeros(motion.rows.n_e)
    push[estimator.loaded_rows] = np.linalg.cholesky(estimator.load_covariance) @ rng.normal(
        size=len(estimator.loaded_rows)
    )
    before = commanded = now.lam if force else stands
    for number in range(count):
        if number % 15 == 5:
            stands = estimator.middle[:n_a] + 0.15 * (states[number % len(states)] - estimator.middle[:n_a])
            commanded = at_rest(motion, stands).lam if force else stands
        astray = 0.02 * estimator.scale[:n_a] if not force and number >= 40 else np.zeros(n_a)
        for share in (0.25, 0.5, 0.75, 1.0):
            acts = {made.kind: before + share * (commanded - before) + astray}
            now = step(motion, now, MotionCommand(**acts, push=push), period / 4)
        before, y = commanded, np.r_[now.q, push[estimator.loaded_rows], 0.0]
        places = estimator.rest + made.markers.seen(y)[0].reshape(-1, 3) + estimator.noise * rng.normal(size=(m, 3))
        sensed = now.q[:n_a] + estimator.sensor * rng.normal(size=n_a) if number % 3 == 0 else np.full(n_a, np.nan)
        if number % 4 == 1:
            places[rng.integers(m)] += 20.0 * rng.normal(size=3)
        if number % 5 == 2:
            places[rng.integers(m)] = np.nan
        if number == 30:
            places[:] = np.nan
        command = np.full(n_a, np.nan) if number % 13 == 12 else commanded
        given = None if np.isnan(command).any() else command
        answer = filtered.tick(places, sensed, given, period if number else 0.0)
        known = filtered.last
        frames.append(
            {"place": places, "displacement": sensed, "force": np.full(n_a, np.nan), "command": command}
            | {"answer": answer, "x": known[0], "covariance": known[1]}
        )
    return frames
