"""One estimate a frame of a recording, and their table."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cfem.identify.states.recording import Recording
from cfem.identify.states.spec import EstimateSpec
from cfem.motion.estimation.marker_filter import MarkerFilter
from cfem.motion.estimation.uncertainty import motion_uncertainty
from cfem.motion.model import MotionModel
from cfem.predict.estimation.answer import Estimate
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import filter_of

Tick = Callable[[int], Estimate]  # number of a frame -> what is known then; called for one frame after the other


def each_alone(estimator: Estimator, recording: Recording) -> Tick:
    """Estimates each frame alone, beginning at the last that has an estimate."""
    last: Estimate | None = None

    def tick(frame: int) -> Estimate:
        nonlocal last
        seen, forces = recording.markers[frame], _if_any(recording.force[frame])
        estimate = estimator.estimate(seen, recording.displacement[frame], last, forces)
        last = estimate if estimate.converged else None
        return estimate

    return tick


def at_rest(estimator: Estimator, recording: Recording, spec: EstimateSpec, ticks: float) -> Tick:
    """Estimates by a filter of a robot that is at rest in each frame; ticks: frames for which a load lasts."""
    filtered = filter_of(spec, estimator.model, 1.0, ticks)

    def tick(frame: int) -> Estimate:
        seen, sensed = recording.markers[frame], recording.displacement[frame]
        return filtered.tick(seen, sensed, _if_all(recording.command[frame]), _if_any(recording.force[frame]))

    return tick


def moving(estimator: Estimator, recording: Recording, spec: EstimateSpec, motion: MotionModel, ticks: float) -> Tick:
    """Estimates by the filter on the condensed dynamics; motion: of the same model; ticks: as of `at_rest`."""
    rate = 1 / recording.period
    uncertainty = motion_uncertainty(spec, estimator.model, rate, ticks / rate)
    filtered = MarkerFilter(estimator, motion, spec.dynamics.driven, uncertainty, spec.gate)

    def tick(frame: int) -> Estimate:
        elapsed = recording.time[frame] - recording.time[frame - 1] if frame else 0.0
        seen, sensed = recording.markers[frame], recording.displacement[frame]
        return filtered.tick(seen, sensed, _if_all(recording.command[frame]), elapsed)

    return tick


def write_estimates(path: Path, estimates: Sequence[Estimate], recording: Recording, estimator: Estimator) -> None:
    """Writes a row a frame: displacements of the actuators, forces, standard deviations, effectors, modes of the
    skin."""
    from cfem.dataset.writer import write_columns

    rows, n_a = estimator.model.rows, estimator.model.rows.n_a
    deviation = np.array([estimate.deviation for estimate in estimates])
    loads = {"loads": np.array([estimate.loads for estimate in estimates]), "loads_sd": deviation[:, n_a:]}
    columns = {
        "frame": np.arange(len(estimates)),
        **({} if recording.time is None else {"time": recording.time}),
        "status": [estimate.status.value for estimate in estimates],
        "delta_a": np.array([estimate.delta_a for estimate in estimates]),
        "delta_a_sd": deviation[:, :n_a],
        **(loads if estimator.loaded else {}),
        "x_e": np.array([estimate.delta_e for estimate in estimates]) + estimator.model.rest_e,
        "skin": np.array([estimate.rows for estimate in estimates]),
        "noise": [estimate.noise for estimate in estimates],
        "outliers": [" ".join(map(str, estimate.outliers)) for estimate in estimates],
        "unseen": [" ".join(estimate.unseen) for estimate in estimates],
    }
    units = {"time": "s", "loads": "N", "loads_sd": "N", "noise": "1"}
    units |= dict.fromkeys(("delta_a", "delta_a_sd", "x_e", "skin"), "mm")
    meta = {"actuators": list(rows.actuators), "loaded": list(estimator.loaded), "effectors": list(rows.effectors)}
    write_columns(path, columns, meta | {"units": units})


def _if_any(numbers: np.ndarray) -> np.ndarray | None:
    """The numbers, None where none was recorded."""
    return numbers if np.isfinite(numbers).any() else None


def _if_all(numbers: np.ndarray) -> np.ndarray | None:
    """The numbers, None where one was not recorded."""
    return numbers if np.isfinite(numbers).all() else None
