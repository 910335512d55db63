"""Commands over time to motion of the condensed model."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from cfem.core.errors import NumericalError
from cfem.motion.model import MotionModel
from cfem.motion.payload import Payload
from cfem.motion.step import Command, Motion, step

_HALVINGS = 8
_FAR = 5.0  # lengths of the robot that no tip gets away from its rest


@dataclass
class Run:
    """t (k,) s; delta_a (k, n_a); delta_e (k, n_e) mm from rest; lam (k, n_a): forces of the actuators in the step that
    ends there; shortened: (t, dt, why) of steps that were halved; left: s, when the state was first unlike those that
    the model has learned from, None where it never was."""

    t: list[float] = field(default_factory=list)
    delta_a: list[np.ndarray] = field(default_factory=list)
    delta_e: list[np.ndarray] = field(default_factory=list)
    lam: list[np.ndarray] = field(default_factory=list)
    shortened: list[tuple[float, float, str]] = field(default_factory=list)
    left: float | None = None
    end: Motion | None = None

    def arrays(self) -> dict[str, np.ndarray]:
        """The columns by name."""
        return {name: np.array(getattr(self, name)) for name in ("t", "delta_a", "delta_e", "lam")}


def simulate(
    model: MotionModel,
    start: Motion,
    command: Callable[[float], Command],
    until: float,
    dt: float,
    payload: Payload | None = None,
) -> Run:
    """From `start` to the time `until`, s, in steps of dt. command: time at the end of a step -> what holds then
    (displacements) or during it (forces). A step that is not found is taken in halves, and `shortened` says so.
    NumericalError where that does not help, and where the motion grows far beyond the robot, as it may where `left`
    says that the model knows nothing."""
    run = Run()
    _note(run, model, start)
    count = max(1, round((until - start.t) / dt))
    length = (until - start.t) / count
    now = start
    for index in range(count):
        end = start.t + (index + 1) * length
        now = replace(_reach(model, now, command, end, payload, run, _HALVINGS), t=end)
        _note(run, model, now)
    run.end = now
    return run


def _reach(
    model: MotionModel,
    now: Motion,
    command: Callable[[float], Command],
    end: float,
    payload: Payload | None,
    run: Run,
    halvings: int,
) -> Motion:
    try:
        return step(model, now, command(end), end - now.t, payload)
    except NumericalError as error:
        if halvings == 0:
            raise
        run.shortened.append((now.t, end - now.t, error.what))
    middle = (now.t + end) / 2
    half = _reach(model, now, command, middle, payload, run, halvings - 1)
    return _reach(model, half, command, end, payload, run, halvings - 1)


def _note(run: Run, model: MotionModel, motion: Motion) -> None:
    delta_a = motion.q[: model.n_a]
    place = model.at(delta_a)
    if run.left is None and not model.static.domain.holds(delta_a, place.pull):
        run.left = motion.t
    delta_e = place.effectors(motion.q[model.n_a :])
    if not np.abs(delta_e).max() <= _FAR * model.static.length:
        where = "" if run.left is None else f", after it left the states that it has learned from at {run.left:g} s"
        raise NumericalError(
            f"the motion grows beyond {_FAR:g} times the robot's length at {motion.t:g} s{where}",
            do="command less, or sample where it goes",
        )
    run.t.append(motion.t)
    run.delta_a.append(delta_a)
    run.delta_e.append(delta_e)
    run.lam.append(motion.lam)
