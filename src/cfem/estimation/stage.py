"""`cfem estimate`: recorded markers to the state of the robot and the forces on it, frame by frame."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.actuator_units import demand_units
from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Command
from cfem.estimation.spec import EstimateSpec
from cfem.predict.estimate_spec import estimator_of

TABLE = "estimates.parquet"


def _work(folder: Path, spec: EstimateSpec, base: Path) -> dict[str, Any]:
    """Results: how many frames were estimated, the noise of the markers relative to the stated one, what was never
    observed, and errors and intervals where the truth is known."""
    from cfem.core.progress import progress
    from cfem.estimation.frames import estimates, write_estimates
    from cfem.estimation.recording import read_recording, read_truth
    from cfem.estimation.summary import summarise
    from cfem.predict.load import load_model

    model = load_model(base / spec.model)
    forces = spec.dynamics is not None and spec.dynamics.driven == "force"
    recording = read_recording(base / spec.recording, list(spec.markers), model.rows, model.actuator_units, forces)
    demand_units(spec, model.actuator_units)
    _demand_noise(spec, recording)
    estimator = estimator_of(spec, model)
    truth = {}
    if spec.truth is not None:
        truth = read_truth(base / spec.truth, estimator.loaded, model.rows, len(recording))
    tick = _tick(spec, base, estimator, recording)
    with progress("frames", len(recording)) as advance:
        found = list(estimates(tick, recording, lambda: advance(1)))
    write_estimates(folder / TABLE, found, recording, estimator)
    seen = _seen(spec, estimator, recording, base)
    return summarise(found, estimator, list(spec.markers), truth, seen, spec.dynamics is None)


def _tick(spec: EstimateSpec, base: Path, estimator: Any, recording: Any) -> Any:
    from cfem.estimation import frames

    if spec.each_frame:
        return frames.each_alone(estimator, recording)
    if spec.dynamics is None:
        return frames.at_rest(estimator, recording, spec, _ticks(spec, recording, base))
    from cfem.motion.load import load_motion

    if recording.period is None:
        what = "has no column 'time [s]', and dynamics go from time to time"
        raise InputError(what, where=str(base / spec.recording), do="record the times, or leave dynamics out")
    if spec.actuators.force is not None:
        what = "load cells measure inertia as well, and the filter on the dynamics cannot separate it"
        raise SpecError(what, where="actuators.force", do="leave it out, or leave dynamics out")
    if spec.dynamics.driven == "force" and not np.isfinite(recording.command).all():
        raise InputError("lacks commanded forces", where=str(base / spec.recording), do="record ACTUATOR.command [N]")
    return frames.moving(estimator, recording, spec, load_motion(base / spec.model), _ticks(spec, recording, base))


def _seen(spec: EstimateSpec, estimator: Any, recording: Any, base: Path) -> Any:
    """What bounds how well a push can be told; None where nothing pushes, or the robot moves."""
    from cfem.estimation.frames import slips
    from cfem.predict.push_bound import Seen

    if not estimator.loaded or spec.dynamics is not None:
        return None
    sensed, forces = (bool(np.isfinite(one).any()) for one in (recording.displacement, recording.force))
    return Seen(*slips(estimator, spec), _ticks(spec, recording, base), sensed, forces)


def _demand_noise(spec: EstimateSpec, recording: Any) -> None:
    """Of what was recorded."""
    for name in ("displacement", "force"):
        if np.isfinite(getattr(recording, name)).any() and getattr(spec.actuators, name) is None:
            if name == "force" and spec.dynamics is not None:
                continue
            what = f"the recording has the actuators' {name}s, and their noise is missing"
            raise SpecError(what, where=f"actuators.{name}", do="state its standard deviation")


def _ticks(spec: EstimateSpec, recording: Any, base: Path) -> float:
    """For how many frames a load lasts."""
    if spec.loads is None or spec.loads.lasts is None:
        return float(max(len(recording), 2))
    if recording.period is None:
        what = "has no column 'time [s]', and loads.lasts is a time"
        raise InputError(what, where=str(base / spec.recording), do="record the times, or leave loads.lasts out")
    return spec.loads.lasts / recording.period


COMMAND = Command("estimate", 2, EstimateSpec, _work, ("model", "recording", "truth"))
run, stage = COMMAND.run, COMMAND.stage
