"""Rows of `loop.parquet` and numbers of the headline, from the ticks of a run."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np

from cfem.control.closed_loop.estimated_account import estimate_sentence
from cfem.control.closed_loop.run import Moment, Pace
from cfem.core.artefact.judgement import poor
from cfem.core.console.shown import duration, length

OFTEN = 0.01  # of the ticks: from there on the headline tells that a bound of a command held
HELD = {"smallest": "smallest command of", "largest": "largest command of", "rate": "largest change of"}


def record(trajectory: str, controller: str, seed: int, rate: float, moment: Moment) -> dict[str, Any]:
    """Row of the table of a tick, lengths in mm; rate: ticks a second."""
    return {
        "trajectory": trajectory,
        "controller": controller,
        "seed": seed,
        "tick": moment.tick,
        "seconds": moment.tick / rate,
        "goal_index": moment.index,
        "goal": moment.goal,
        "aimed": moment.aimed,
        "x_e": moment.actual.x_e,
        "measured_e": moment.measured.x_e,
        "measured_tick": moment.measured.t,
        "error": moment.error,
        "command": moment.belief.u,
        "delta_a": moment.belief.delta_a,
        "status": moment.belief.status,
        "plant_status": moment.actual.status,
        "step_us": 1e6 * moment.cpu,
    }


def summarise(runs: Sequence[Sequence[Moment]], goals: int, pace: Pace, rate: float) -> dict[str, Any]:
    """Results of one controller on one trajectory, all seeds together. Goals of a run-up do not count.

    reached: goals a run, as `Pace` has it, or within its radius when the next one was due; error: mm at every tick,
    the first goal's left out where goals come by the clock (the robot is on its way there), error_at_goals: when the
    next one was due; ticks_to_converge: to the first of the ticks that held, of goals that were held; no_position:
    ticks without one from the plant; step_us: CPU."""
    each = [[list(visit) for _, visit in groupby(run, key=lambda moment: moment.index)] for run in runs]
    timed = pace.ticks_a_goal is not None
    uncounted = pace.run_up or (1 if timed and goals > 1 else 0)
    ends = [visit[-1].error for visits in each for visit in visits[pace.run_up :]]
    on_the_way = [moment.error for visits in each for visit in visits[uncounted:] for moment in visit]
    cpu = [1e6 * moment.cpu for run in runs for moment in run]
    waits = [wait for visits in each for visit in visits if (wait := _wait(visit, pace)) is not None]
    reached = [sum(_reached(visit, pace) for visit in visits[pace.run_up :]) for visits in each]
    return {
        "runs": len(runs),
        "goals": goals - pace.run_up,
        "reached": {"mean": float(np.mean(reached)), "min": min(reached), "max": max(reached)},
        "ticks": float(np.mean([len(run) for run in runs])),
        "seconds": float(np.mean([len(run) for run in runs]) / rate),
        "error": _spread(on_the_way),
        "error_at_goals": _spread(ends),
        "ticks_to_converge": None
        if timed
        else {
            "held": len(waits),
            "of": sum(map(len, each)),
            "median": float(np.median(waits)) if waits else None,
            "max": max(waits, default=None),
        },
        "seconds_to_converge": float(np.median(waits) / rate) if waits and not timed else None,
        "no_position": sum(_without_position(moment) for run in runs for moment in run),
        "step_us": {
            "median": float(np.median(cpu)),
            "p99": float(np.percentile(cpu, 99)),
            "max": max(cpu),
        },
    }


def headline(results: dict[str, dict[str, dict]]) -> list[str]:
    """One sentence a trajectory and controller."""
    lines = []
    for trajectory, controllers in results.items():
        for name, row in controllers.items():
            error, wait = row["error_at_goals"], row["ticks_to_converge"]
            parts = [f"{row['reached']['mean']:g} of {row['goals']} goals reached in {row['seconds']:.3g} s"]
            if wait and wait["held"]:
                parts.append(f"after {wait['median']:g} ticks each, {wait['max']} at most")
            if error:
                parts.append(
                    f"tracking error mean {length(error['mean'])}, max {length(error['max'])} when the next was due"
                )
            parts.append(f"{duration(1e-6 * row['step_us']['median'])} of CPU time per tick")
            parts += _saturated(row.get("saturated", {}))
            if (beyond := row.get("unstable")) is not None:
                bound = f"below {beyond['stable_below']:.2g} where samples come {beyond['late']} late"
                parts.append(f"gains.integral {beyond['integral']:g} is UNSTABLE: stable {bound}")
            if "estimate" in row:
                parts.append(estimate_sentence(row["estimate"]))
            if row["no_position"]:
                parts.append(f"the plant gave NO POSITION in {row['no_position']} ticks")
            lines.append(f"{trajectory}, {name}: " + "; ".join(parts))
    return lines


def judged(results: Mapping[str, dict[str, dict]]) -> list[dict[str, Any]]:
    """Findings that make a run poor: trajectories on which every controller misses most goals. Single controllers may:
    they are compared."""
    findings = []
    for trajectory, controllers in results.items():
        name, row = max(controllers.items(), key=lambda item: item[1]["reached"]["mean"])
        reached, goals = row["reached"]["mean"], row["goals"]
        if 2 * (goals - reached) > goals:
            findings.append(poor(f"{trajectory}: the best controller, {name}, reaches {reached:g} of {goals} goals"))
    return findings


def _saturated(shares: Mapping[str, float]) -> list[str]:
    """One part for each kind of bound that held in `OFTEN` of the ticks or more; keys of actuators are 'name: kind'."""
    parts: dict[str, list[str]] = {}
    for key, share in shares.items():
        name, _, kind = key.rpartition(": ")
        if share >= OFTEN or not name:
            parts.setdefault(HELD.get(kind, kind), []).append(f"{name} in {100 * share:.3g} %".strip())
    return [f"{kind} {', '.join(actuators)} of the ticks" for kind, actuators in parts.items()]


def _reached(visit: list[Moment], pace: Pace) -> bool:
    return visit[-1].error <= pace.radius if pace.ticks_a_goal is not None else _wait(visit, pace) is not None


def _wait(visit: list[Moment], pace: Pace) -> int | None:
    """Ticks until the robot came to stay, None where it did not."""
    last = visit[-pace.hold :]
    stayed = len(last) == pace.hold and all(moment.error <= pace.radius for moment in last)
    return len(visit) - pace.hold + 1 if stayed else None


def _without_position(moment: Moment) -> bool:
    """True where the plant gave no position in a tick."""
    return moment.actual.status != "converged" and moment.actual.t > 0


def _spread(values: Sequence[float]) -> dict[str, float] | None:
    known = np.array([value for value in values if np.isfinite(value)])
    if not len(known):
        return None
    return {"mean": float(known.mean()), "max": float(known.max()), "rms": float(np.sqrt((known**2).mean()))}
