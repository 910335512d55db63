"""One estimate a frame of a recording, and their table."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from cfem.estimation.recording import Recording
from cfem.estimation.spec import EstimateSpec
from cfem.motion.marked_steps import unknown_of
from cfem.motion.marker_filter import MarkerFilter
from cfem.motion.model import MotionModel
from cfem.predict.estimate import Estimator
from cfem.predict.estimate_answer import Estimate
from cfem.predict.estimate_filter import OFFSET, SLIP, Filter

Tick = Callable[[int], Estimate]  # number of a frame -> what is known then; asked of one after the other


def estimates(tick: Tick, recording: Recording, after: Callable[[], None]) -> Iterator[Estimate]:
    """after(): called behind each frame."""
    for frame in range(len(recording)):
        yield tick(frame)
        after()


def each_alone(estimator: Estimator, recording: Recording) -> Tick:
    last: Estimate | None = None

    def tick(frame: int) -> Estimate:
        nonlocal last
        seen, forces = recording.markers[frame], _some(recording.force[frame])
        found = estimator.estimate(seen, recording.displacement[frame], last, forces)
        last = found if found.converged else None
        return found

    return tick


def at_rest(estimator: Estimator, recording: Recording, spec: EstimateSpec, ticks: float) -> Tick:
    """By a filter of a robot that is at rest in each frame. ticks: frames for which a load lasts."""
    slip, offset = slips(estimator, spec)
    filtered = Filter(estimator, slip, ticks, offset, spec.gate)

    def tick(frame: int) -> Estimate:
        seen, sensed = recording.markers[frame], recording.displacement[frame]
        return filtered.tick(seen, sensed, _whole(recording.command[frame]), _some(recording.force[frame]))

    return tick


def moving(estimator: Estimator, recording: Recording, spec: EstimateSpec, motion: MotionModel, ticks: float) -> Tick:
    """By the filter on the condensed dynamics. motion: of the same model."""
    (slip, offset), period = slips(estimator, spec), recording.period
    doubt = unknown_of(spec.dynamics, slip / np.sqrt(period), offset, ticks * period, estimator.model.length)
    filtered = MarkerFilter(estimator, motion, spec.dynamics.driven, doubt, spec.gate)

    def tick(frame: int) -> Estimate:
        after = recording.time[frame] - recording.time[frame - 1] if frame else 0.0
        seen, sensed = recording.markers[frame], recording.displacement[frame]
        return filtered.tick(seen, sensed, _whole(recording.command[frame]), after)

    return tick


def slips(estimator: Estimator, spec: EstimateSpec) -> tuple[float, float]:
    """mm: slip from frame to frame, and offset."""
    reach = float(np.abs(estimator.model.reach).max())
    return spec.actuators.slip or SLIP * reach, spec.actuators.offset or OFFSET * reach


def write_estimates(path: Path, found: Sequence[Estimate], recording: Recording, estimator: Estimator) -> None:
    """A row a frame: displacements of the actuators, forces, standard deviations, effectors, modes of the skin."""
    from cfem.dataset.writer import write_columns

    rows, n_a = estimator.model.rows, estimator.model.rows.n_a
    deviation = np.array([one.deviation for one in found])
    columns = {
        "frame": np.arange(len(found)),
        **({} if recording.time is None else {"time": recording.time}),
        "status": [one.status.value for one in found],
        "delta_a": np.array([one.delta_a for one in found]),
        "delta_a_sd": deviation[:, :n_a],
        **(
            {"loads": np.array([one.loads for one in found]), "loads_sd": deviation[:, n_a:]}
            if estimator.loaded
            else {}
        ),
        "x_e": np.array([one.delta_e for one in found]) + estimator.model.rest_e,
        "skin": np.array([one.rows for one in found]),
        "noise": [one.noise for one in found],
        "outliers": [" ".join(map(str, one.outliers)) for one in found],
        "unseen": [" ".join(one.unseen) for one in found],
    }
    units = {"time": "s", "delta_a": "mm", "delta_a_sd": "mm", "loads": "N", "loads_sd": "N", "x_e": "mm", "skin": "mm"}
    meta = {"actuators": list(rows.actuators), "loaded": list(estimator.loaded), "effectors": list(rows.effectors)}
    write_columns(path, columns, meta | {"units": units | {"noise": "1"}})


def _some(numbers: np.ndarray) -> np.ndarray | None:
    return numbers if np.isfinite(numbers).any() else None


def _whole(numbers: np.ndarray) -> np.ndarray | None:
    return numbers if np.isfinite(numbers).all() else None
