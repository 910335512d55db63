"""`cfem estimate`: recorded markers to the state of the robot and the forces on it, frame by frame."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.actuator_units import demand_units
from cfem.core.errors import InputError, SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options, Stage, run_stage
from cfem.estimation.spec import EstimateSpec
from cfem.predict.estimate_spec import estimator_of

TABLE = "estimates.parquet"
_PATHS = ("model", "recording", "truth")


def run(spec_path: Path, overrides: Sequence[str], out: Path | None, options: Options) -> dict[str, Any]:
    """The manifest; results: how many frames were estimated, the noise of the markers relative to the stated one, what
    was never observed, and errors and intervals where the truth is known."""
    made, base = stage(spec_path, overrides, out), spec_path.parent
    return run_stage(made, partial(_work, spec=made.spec, base=base), options)


def stage(spec_path: Path, overrides: Sequence[str] = (), out: Path | None = None) -> Stage:
    spec, base = load_spec(spec_path, EstimateSpec, overrides), spec_path.parent
    return Stage(
        name="estimate",
        version=2,
        spec=spec,
        inputs={name: base / getattr(spec, name) for name in _PATHS if getattr(spec, name) is not None},
        out=out or base / spec.out,
        paths=(*_PATHS, "out"),
        spec_path=spec_path,
        overrides=overrides,
    )


def _work(folder: Path, spec: EstimateSpec, base: Path) -> dict[str, Any]:
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
        what = "load cells measure inertia too, which the filter on the dynamics does not take apart"
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
