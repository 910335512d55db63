"""`cfem estimate`: recorded markers to the state of the robot and the forces on it, frame by frame."""

from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.actuator_units import demand_units
from cfem.core.errors import InputError, SpecError
from cfem.core.stage import Command
from cfem.identify.states.spec import EstimateSpec
from cfem.predict.estimation.spec import estimator_of

TABLE = "estimates.parquet"


def _work(folder: Path, spec: EstimateSpec, base: Path) -> dict[str, Any]:
    """Results: how many frames were estimated, the noise of the markers relative to the stated one, what was never
    observed, and errors and intervals where the truth is known."""
    from cfem.core.console.progress import progress
    from cfem.identify.states.frames import write_estimates
    from cfem.identify.states.recording import read_frames, read_truth
    from cfem.identify.states.results import errors_and_coverage, estimate_results
    from cfem.identify.states.text import headline, judgement, truth_line
    from cfem.predict.load import load_model

    model = load_model(base / spec.model)
    command = "displacement" if spec.dynamics is None else spec.dynamics.driven
    recording = read_frames(base / spec.recording, list(spec.markers), model.rows, model.actuator_units, command)
    demand_units(spec, model.actuator_units)
    _demand_noise(spec, recording)
    estimator = estimator_of(spec, model)
    truth = {}
    if spec.truth is not None:
        truth = read_truth(base / spec.truth, estimator.loaded, model.rows, len(recording))
    tick, estimates = _tick(spec, base, estimator, recording), []
    with progress("frames", len(recording)) as advance:
        for frame in range(len(recording)):
            estimates.append(tick(frame))
            advance(1)
    write_estimates(folder / TABLE, estimates, recording, estimator)
    sensing = _sensing(spec, estimator, recording, base)
    against_truth = errors_and_coverage(estimates, estimator, truth)
    results = estimate_results(estimates, estimator, list(spec.markers), against_truth, sensing)
    lines = headline(results, estimates, estimator, at_rest=spec.dynamics is None)
    if against_truth:
        lines.append(truth_line([covered for _, covered in against_truth.values()]))
    judged = judgement(results, estimates, len(spec.markers))
    return {"headline": lines, **results} | ({"judgement": judged} if judged else {})


def _tick(spec: EstimateSpec, base: Path, estimator: Any, recording: Any) -> Any:
    """The estimator of one frame after the other. InputError and SpecError where the recording lacks what the dynamics
    need."""
    from cfem.identify.states import frames

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


def _sensing(spec: EstimateSpec, estimator: Any, recording: Any, base: Path) -> Any:
    """Bounds of how well a push can be estimated; None where nothing pushes, or the robot moves."""
    from cfem.predict.estimation.filter import slip_and_offset
    from cfem.predict.estimation.push_bound import Seen

    if not estimator.loaded or spec.dynamics is not None:
        return None
    sensed, forces = (bool(np.isfinite(numbers).any()) for numbers in (recording.displacement, recording.force))
    return Seen(*slip_and_offset(spec, estimator.model), _ticks(spec, recording, base), sensed, forces)


def _demand_noise(spec: EstimateSpec, recording: Any) -> None:
    """Raises SpecError where the noise of what was recorded of the actuators is missing."""
    for name in ("displacement", "force"):
        if np.isfinite(getattr(recording, name)).any() and getattr(spec.actuators, name) is None:
            if name == "force" and spec.dynamics is not None:
                continue
            what = f"the recording has the actuators' {name}s, and their noise is missing"
            raise SpecError(what, where=f"actuators.{name}", do="state its standard deviation")


def _ticks(spec: EstimateSpec, recording: Any, base: Path) -> float:
    """Number of frames for which a load lasts. InputError where that needs times which were not recorded."""
    if spec.loads is None or spec.loads.lasts is None:
        return float(max(len(recording), 2))
    if recording.period is None:
        what = "has no column 'time [s]', and loads.lasts is a time"
        raise InputError(what, where=str(base / spec.recording), do="record the times, or leave loads.lasts out")
    return spec.loads.lasts / recording.period


COMMAND = Command("estimate", 2, EstimateSpec, _work, ("model", "recording", "truth"))
run, stage = COMMAND.run, COMMAND.stage
