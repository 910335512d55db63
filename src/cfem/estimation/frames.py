"""One estimate a frame of a recording, and their table."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from cfem.estimation.recording import Recording
from cfem.estimation.spec import EstimateSpec
from cfem.predict.estimate import Estimator
from cfem.predict.estimate_answer import Estimate
from cfem.predict.estimate_filter import OFFSET, SLIP, Filter


def estimates(
    estimator: Estimator, recording: Recording, spec: EstimateSpec, ticks: float, after: Callable[[], None]
) -> Iterator[Estimate]:
    """ticks: frames for which a load lasts; after(): called behind each frame."""
    reach, last = float(np.abs(estimator.model.reach).max()), None
    filtered = Filter(estimator, spec.actuators.slip or SLIP * reach, ticks, spec.actuators.offset or OFFSET * reach)
    for frame in range(len(recording)):
        seen, sensed, forces = recording.markers[frame], recording.displacement[frame], recording.force[frame]
        if spec.each_frame:
            found = estimator.estimate(seen, sensed, last, _some(forces))
            last = found if found.converged else None
            yield found
        else:
            yield filtered.tick(seen, sensed, _whole(recording.command[frame]), _some(forces))
        after()


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
