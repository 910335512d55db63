"""Motion under commands over time: implicit steps of adaptive length.

A step is halved where Newton's method does not find it, or an element would invert, and where the estimate of what it
leaves out is above the tolerance; what was asked of a shorter step stands in `refused`. Steps are doubled where the
estimate allows for it, and end where the commands have a kink. One factorisation serves as many steps of a length as
it converges for. A cable that would have to push goes slack, and is pulled again where it would be too long."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from cfem.equilibrium.newton import NewtonResult, NewtonSettings, newton
from cfem.equilibrium.system.actuation import Actuation, pulling_only
from cfem.equilibrium.system.evaluation import SolveCost, Tangent
from cfem.equilibrium.system.robot import demand_without_discrepancy, effector_displacements
from cfem.equilibrium.system.solution import State, Status
from cfem.fe_motion import energy as energies
from cfem.fe_motion.energy import Energy
from cfem.fe_motion.problem import MovingEvaluation, MovingProblem, TimeStep
from cfem.fe_motion.scheme import Motion, Scheme
from cfem.mechanics import viscosity as viscous

Command = Callable[[float], Actuation]
_STEP = NewtonSettings(tolerance=1e-8, max_iterations=12)


@dataclass(frozen=True)
class StepControl:
    """Lengths of the steps.

    first: s of the first step, and of each after a kink
    longest, shortest: s
    tolerance: mm that a step may leave out, at the node where it is most, None for steps of `first` throughout
    newton: of each step"""

    first: float = 1e-3
    longest: float = 0.1
    shortest: float = 1e-9
    tolerance: float | None = 1e-2
    newton: NewtonSettings = _STEP


@dataclass(frozen=True)
class RefusedStep:
    """A step of dt s from t s that was not taken, and why."""

    t: float
    dt: float
    why: str


@dataclass(frozen=True)
class Sample:
    """Sample of a motion."""

    t: float  # s
    delta: np.ndarray  # (n_active,) of the active rows
    lam: np.ndarray  # of the active rows
    delta_e: np.ndarray  # (n_e,) of the effectors
    slack: np.ndarray  # (n_a,)
    energy: Energy


@dataclass
class MotionRun:
    """A simulated motion.

    samples: at the start and after each step
    refused: steps that were tried in vain
    why: the motion ended before its time, None where it did not
    end: the last motion
    cost: of all
    power: N mm/s of the overstress at the end
    kept: the factored tangent, for a run that goes on from here"""

    samples: list[Sample]
    end: Motion
    refused: list[RefusedStep] = field(default_factory=list)
    why: str | None = None
    cost: SolveCost = field(default_factory=SolveCost)
    power: float = 0.0
    kept: "KeptTangent | None" = None

    @property
    def t(self) -> np.ndarray:
        """Times (k,) s."""
        return np.array([sample.t for sample in self.samples])

    def of(self, name: str) -> np.ndarray:
        """Values (k, ...) of one attribute of the samples."""
        return np.array([getattr(sample, name) for sample in self.samples])


def simulate(
    problem: MovingProblem,
    start: Motion,
    command: Command,
    until: float,
    kinks: Sequence[float] = (),
    pace: StepControl | None = None,
    scheme: Scheme | None = None,
    kept: "KeptTangent | None" = None,
) -> MotionRun:
    """Simulates the motion from `start` to the time `until`, s.

    command: time -> what is prescribed to the active rows
    kinks: times at which the command is not smooth
    kept: tangent of the run that ended at `start`"""
    demand_without_discrepancy(problem.robot, "motion")
    run, pace, scheme = MotionRun([], start), pace or StepControl(), scheme or Scheme()
    run.samples.append(_sample(problem, start, energies.at_start(problem, start), None))
    ends = [*sorted(t for t in kinks if start.t < t < until), until]
    dt, motion = pace.first, start
    for end in ends:
        dt = min(dt, pace.first) if motion.t > start.t else dt
        settling = True  # the step after a kink, whose jump in acceleration is real
        while motion.t < end - 1e-12 * max(1.0, end):
            even = (end - motion.t) / np.ceil((end - motion.t) / dt * (1 - 1e-9))
            length = even if even > 0.7 * dt else dt
            tried, kept, why = _step(problem, scheme, motion, command, length, pace, run.cost, kept)
            run.kept = kept
            error = scheme.error(motion, length, tried.motion.lag) if tried else np.inf
            if tried and pace.tolerance is not None and error > pace.tolerance and not settling:
                why, tried = f"it would leave out {error:.2g} mm", None
            if tried is None:
                run.refused.append(RefusedStep(motion.t, length, why))
                dt = length / 2
                if dt < pace.shortest:
                    run.why = f"the step at {motion.t:.6g} s fell below {pace.shortest:g} s: {why}"
                    return run
                continue
            settling = False
            run.samples.append(_sample(problem, tried.motion, _energy(problem, run, motion, tried), tried))
            motion = run.end = tried.motion
            if pace.tolerance is not None and error < pace.tolerance / 10:
                dt = min(2 * dt, pace.longest)
    return run


@dataclass(frozen=True)
class _TakenStep:
    """A step: the motion at its end, the equations there, their result, and which rows were held."""

    motion: Motion
    moving: MovingProblem
    result: NewtonResult
    slack: np.ndarray


@dataclass(frozen=True)
class KeptTangent:
    """A factored tangent, and the c of the step it was made for."""

    tangent: Tangent
    inertia: float


def _step(
    problem: MovingProblem,
    scheme: Scheme,
    begin: Motion,
    command: Command,
    dt: float,
    pace: StepControl,
    cost: SolveCost,
    kept: KeptTangent | None,
) -> tuple[_TakenStep | None, KeptTangent | None, str]:
    """Takes one step; None and the cause where it fails."""
    c, origin, offset = scheme.acceleration(begin, dt)
    over = None if begin.memory is None else viscous.overstress(problem.body, problem.viscosity, begin.memory, dt)
    moving = problem.during(TimeStep(c, origin, offset, over))
    actuation = pulling_only(command(begin.t + dt).padded(problem.n_active), problem.robot.unilateral)
    start = State(begin.x + dt * begin.v + dt**2 / 2 * begin.a, begin.pressure, begin.lam, actuation.load)
    cost.steps += 1
    usable = kept.tangent if kept is not None and abs(kept.inertia / c - 1) < 0.05 else None
    result = newton(moving, start, actuation, pace.newton, cost, usable)
    if result.status is not Status.CONVERGED and usable is not None:
        result = newton(moving, start, actuation, pace.newton, cost)  # the tangent was of too far away
    kept = None if result.tangent is None else KeptTangent(result.tangent, c)
    if result.status is not Status.CONVERGED:
        return None, kept, f"Newton's method: {result.status.value}"
    end = result.at
    v, a, lag = scheme.after(begin, dt, end.x)
    if not (np.isfinite(a).all() and np.isfinite(end.x).all()):
        return None, None, "numbers that are not finite"
    memory = None
    if begin.memory is not None:
        memory = viscous.remembered(problem.body, problem.viscosity, begin.memory, dt, end.response)
    motion = Motion(begin.t + dt, end.x, v, a, lag, end.pressure, result.lam, memory)
    slack = actuation.C[~result.held].any(axis=0)[: problem.robot.rows.n_a]
    return _TakenStep(motion, moving, result, slack), kept, ""


def _sample(problem: MovingProblem, motion: Motion, energy: Energy, taken: _TakenStep | None) -> Sample:
    robot = problem.robot
    evaluation = problem.evaluate(motion.x, np.empty(0)) if taken is None else taken.result.at
    slack = np.zeros(robot.rows.n_a, dtype=bool) if taken is None else taken.slack
    return Sample(motion.t, evaluation.delta, motion.lam, effector_displacements(robot, motion.x), slack, energy)


def _energy(problem: MovingProblem, run: MotionRun, before: Motion, taken: _TakenStep) -> Energy:
    """Energy after a step: work since the last sample by the trapezoidal rule."""
    last, motion, evaluation = run.samples[-1], taken.motion, taken.result.at
    work = float((last.lam + motion.lam) @ (evaluation.delta - last.delta)) / 2
    lost = 0.0
    if isinstance(evaluation, MovingEvaluation) and problem.viscosity:
        # the overstress at the end on the motion of the step: of second order with that at its beginning
        power = energies.viscous_power(taken.moving, evaluation, motion.v)
        lost = (motion.t - before.t) * (power + run.power) / 2
        run.power = power
    kinetic = energies.kinetic(problem, motion.v)
    potential = problem.potential(evaluation)
    return Energy(kinetic, potential, last.energy.viscous + lost, last.energy.actuators + work)
