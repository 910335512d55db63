"""Commands over time to motion of the condensed model."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from cfem.core.errors import NumericalError
from cfem.motion.model import MotionModel
from cfem.motion.payload import Payload
from cfem.motion.step import CondensedMotion, MotionCommand, step

_HALVINGS = 8
_ROUNDING = 1e-9  # of the largest force, below which a cable does not push
_FAR = 5.0  # lengths of the robot that no tip gets away from its rest


@dataclass
class SimulatedMotion:
    """Motion over time, at k times.

    t: (k,) s
    delta_a, delta_e: (k, n_a), and (k, n_e) mm from rest
    lam: (k, n_a) forces of the actuators in the step that ends there
    slack: (k, n_a) cables that carried nothing in it
    shortened: (t, dt, why) of steps that were halved
    left: s, when the state was first unlike those that the model has learned from, None where it never was"""

    t: list[float] = field(default_factory=list)
    delta_a: list[np.ndarray] = field(default_factory=list)
    delta_e: list[np.ndarray] = field(default_factory=list)
    lam: list[np.ndarray] = field(default_factory=list)
    slack: list[np.ndarray] = field(default_factory=list)
    shortened: list[tuple[float, float, str]] = field(default_factory=list)
    left: float | None = None
    end: CondensedMotion | None = None

    def arrays(self) -> dict[str, np.ndarray]:
        """Columns of a motion, by name."""
        return {name: np.array(getattr(self, name)) for name in ("t", "delta_a", "delta_e", "lam", "slack")}


def simulate(
    model: MotionModel,
    start: CondensedMotion,
    command: Callable[[float], MotionCommand],
    until: float,
    dt: float,
    payload: Payload | None = None,
    unilateral: np.ndarray | None = None,
) -> SimulatedMotion:
    """Motion from `start` to the time `until`, s, in steps of dt. command: time at the end of a step -> what holds then
    (displacements) or during it (forces). unilateral: (n_a,) cables that go slack instead of pushing, and are held
    again where they would be longer than commanded; none unless given. A step that is not found is taken in halves, and
    `shortened` says so. NumericalError where that does not help; where the learned energy is unstable after the motion
    has left the states that it was learned from; and where the motion grows far beyond the robot."""
    run, none = SimulatedMotion(), np.zeros(model.n_a, dtype=bool)
    advance = partial(_advance, model, none if unilateral is None else np.asarray(unilateral, bool))
    _note(run, model, start, none)
    count = max(1, round((until - start.t) / dt))
    length = (until - start.t) / count
    now, slack = start, none
    for index in range(count):
        end = start.t + (index + 1) * length
        now, slack = _reach(advance, now, slack, command, end, payload, run, _HALVINGS)
        now = replace(now, t=end)
        _note(run, model, now, slack)
    run.end = now
    return run


def _reach(
    advance: Callable[..., tuple[CondensedMotion, np.ndarray]],
    now: CondensedMotion,
    slack: np.ndarray,
    command: Callable[[float], MotionCommand],
    end: float,
    payload: Payload | None,
    run: SimulatedMotion,
    halvings: int,
) -> tuple[CondensedMotion, np.ndarray]:
    """Motion and slack cables at `end`, in one step or, where that fails, in halves."""
    try:
        return advance(now, slack, command(end), end - now.t, payload)
    except NumericalError as error:
        if halvings == 0:
            raise
        run.shortened.append((now.t, end - now.t, error.what))
    middle = (now.t + end) / 2
    half, slack = _reach(advance, now, slack, command, middle, payload, run, halvings - 1)
    return _reach(advance, half, slack, command, end, payload, run, halvings - 1)


def _advance(
    model: MotionModel,
    unilateral: np.ndarray,
    now: CondensedMotion,
    slack: np.ndarray,
    command: MotionCommand,
    dt: float,
    payload: Payload | None,
) -> tuple[CondensedMotion, np.ndarray]:
    """Motion after one step, and which cables were slack in it: begun with those of the step before, changed one at a
    time, the worst first. NumericalError where no choice fits."""
    if command.displacement is None or not unilateral.any():
        return step(model, now, command, dt, payload), slack & False
    slack, tried = slack.copy(), set()
    while tuple(slack) not in tried:
        tried.add(tuple(slack))
        stepped = step(model, now, replace(command, slack=slack), dt, payload)
        force = max(float(np.abs(stepped.lam).max()), 1e-12)
        pushes = np.where(unilateral & ~slack, -stepped.lam / (_ROUNDING * force), 0.0)
        lacks = np.where(slack, (command.displacement - stepped.q[: model.n_a]) / (1e-9 * model.static.length), 0.0)
        wrong = np.maximum(pushes, lacks)
        worst = int(np.argmax(wrong))
        if wrong[worst] <= 1.0:
            return stepped, slack
        slack[worst] = not slack[worst]
    raise NumericalError(f"no choice of slack cables fits the step of {dt:g} s at {now.t:g} s", do="take shorter steps")


def _note(run: SimulatedMotion, model: MotionModel, motion: CondensedMotion, slack: np.ndarray) -> None:
    """Notes a state of the run. NumericalError where the energy pushes away or the motion grows far beyond the
    robot."""
    delta_a = motion.q[: model.n_a]
    place = model.at(delta_a)
    if run.left is None and not model.static.domain.holds(delta_a, place.pull):
        run.left = motion.t
    if run.left is not None and not np.linalg.eigvalsh(place.stiff)[0] > 0:
        raise NumericalError(
            f"the learned energy pushes the robot away instead of back at {motion.t:g} s, after the motion left the "
            f"states that it has learned from at {run.left:g} s",
            do="command less, or sample where it goes",
        )
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
    run.slack.append(slack)
