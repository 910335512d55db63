"""Summary at the top of a page: whether the result is good, and the three numbers that matter."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.control.open_loop.summary import JUDGED
from cfem.control.search.optimality import Verdict
from cfem.control.task.run_spec import FE_BASED
from cfem.core.console.shown import duration, length, times
from cfem.report.page import Number, Summary
from cfem.report.sections.tracking import Tracking


@dataclass(frozen=True)
class Outcome:
    """Outcome of one controller on all trajectories, by goal.

    error: (m,) mm, NaN where the robot failed
    reachable: (m,) where nothing shows that the goal is out of reach, by FE-based control where it ran
    converged: (m,) whether the search ended at an optimum, likewise
    inside: (m,) whether the plan stayed within what the model was trained on
    step_us: (m,) us of a step"""

    who: str
    error: np.ndarray
    reachable: np.ndarray
    converged: np.ndarray
    inside: np.ndarray
    step_us: np.ndarray

    @classmethod
    def of(cls, tracking: Tracking) -> "Outcome":
        """Outcome of the first learned controller."""
        parts = [(name, tracking.learned(name)) for name in tracking.summaries]
        rows = [tracking.of(name, who) for name, who in parts]
        judged = [tracking.of(name, FE_BASED if FE_BASED in tracking.summaries[name] else who) for name, who in parts]
        columns = [
            np.concatenate([rows_of_part[key] for rows_of_part in rows]) for key in ("error", "inside", "step_us")
        ]
        reachable = np.concatenate([judged_rows["reachable"] for judged_rows in judged])
        converged = np.concatenate(
            [np.asarray(judged_rows["verdict"]) != Verdict.NOT_CONVERGED.value for judged_rows in judged]
        )
        return cls(parts[0][1], columns[0], reachable, converged, *columns[1:])


def tracking_summary(tracking: Tracking) -> Summary:
    """Summary of the first learned controller, judged by the robot."""
    outcome, limit = Outcome.of(tracking), tracking.spec["reached"]
    able, reached = int(outcome.reachable.sum()), int((outcome.error[outcome.reachable] <= limit).sum())
    away = len(outcome.error) - able
    plant = "finite-element robot" if tracking.plant == "fem" else "model"
    known = "goals within reach" if outcome.converged.all() else "goals that are not shown to be out of reach"
    sentence = f"The {plant} reaches {reached} of {able} {known}, driven by the learned model '{outcome.who}'."
    if away:
        sentence += f" {away} goal{'s lie' if away > 1 else ' lies'} out of its reach: it ends at the nearest point."
    within = (f"within {length(limit)}", *((f"{away} more out of reach",) if away else ()))
    numbers = [Number(f"{reached} of {able}", "goals reached", within)]
    known = outcome.error[outcome.reachable & np.isfinite(outcome.error)]
    if len(known):
        mesh = (tracking.discretisation or {}).get("tip_mm", 0.0)
        if mesh > known.max():
            sentence += (
                f" The mesh itself leaves up to {length(mesh, digits=2)} uncertain at the tip, more than the tracking "
                "error."
            )
        numbers.append(Number(length(known.mean()), "mean tracking error", _beside(known, tracking)))
    numbers.append(_time(tracking, outcome.step_us))
    return Summary(sentence, tuple(_concerns(outcome, tracking, reached)), tuple(numbers))


def _concerns(outcome: Outcome, tracking: Tracking, reached: int) -> Iterator[str]:
    """Concerns about a run, each a clause."""
    able, limit = int(outcome.reachable.sum()), tracking.spec["reached"]
    lost = int((~outcome.converged).sum())
    if lost:
        yield f"the search for {lost} of {len(outcome.error)} goals did not converge"
    if reached < able:
        yield f"{outcome.who} misses {able - reached} of the {able} goals in reach by more than {length(limit)}"
    if not able:
        yield f"none of the {len(outcome.error)} goals is in reach of the robot"
    outside = int((outcome.reachable & ~outcome.inside).sum())
    if outside and tracking.plant != "fem":  # where FE judges, the tracking error says what that is worth
        yield f"plans for {outside} goals in reach lie outside the states that {outcome.who} was trained on"


def _beside(error: np.ndarray, tracking: Tracking) -> tuple[str, str]:
    """Notes beside the mean tracking error."""
    text, mesh = f"largest {length(error.max())}, {JUDGED[tracking.plant]}", tracking.discretisation or {}
    if "tip_mm" in mesh:
        return text, f"discretisation error of the tip: up to {length(mesh['tip_mm'], digits=2)} (estimated)"
    why = f": {mesh['left_out']}" if "left_out" in mesh else ""
    return text, f"discretisation error: not estimated{why}"


def _time(tracking: Tracking, step_us: np.ndarray) -> Number:
    """Time per control step, beside an FE solve."""
    step, solve, name = 1e-6 * float(np.median(step_us)), tracking.fe_seconds, "per control step (median)"
    if not solve:
        return Number(duration(step), name)
    note = f"one FE solve of this robot takes {duration(solve)}, {times(solve / step)} times as long"
    return Number(duration(step), name, (note,))


def loops_summary(loops: Mapping[str, Mapping[str, Mapping[str, dict]]]) -> Summary:
    """Summary of runs over time. loops: results of `cfem control` over time, by their names: goals of the best
    controller of each run, of several that reach as many the one with the smallest error."""
    runs = [(name, result) for name, trajectories in loops.items() for result in trajectories.values()]
    best = [(name, *max(controllers.items(), key=lambda item: _merit(item[1]))) for name, controllers in runs]
    poor = [best_of_run for best_of_run in best if _share(best_of_run[2]) < 1]
    concerns = [
        f"in {name} no controller reaches all goals; the best, {who}, reaches {_goals(result)}"
        for name, who, result in poor
    ]
    if len(best) > 1:
        reached = len(best) - len(poor)
        sentence = f"In {reached} of {len(best)} runs over time at least one controller reaches every goal."
        return Summary(sentence, tuple(concerns))
    ((_, who, result),) = best
    sentence = f"Controller {who} reaches {_goals(result)} goals over time."
    numbers = [Number(_goals(result), "goals reached", (f"by controller {who}, the best of the run",))]
    if result["error_at_goals"]:
        mean, largest = (length(result["error_at_goals"][key]) for key in ("mean", "max"))
        numbers.append(Number(mean, "mean error when the next goal was due", (f"largest {largest}",)))
    numbers.append(Number(duration(1e-6 * result["step_us"]["median"]), "CPU time per tick (median)"))
    return Summary(sentence, tuple(concerns), tuple(numbers))


def _goals(result: Mapping[str, Any]) -> str:
    return f"{result['reached']['mean']:g} of {result['goals']}"


def _share(result: Mapping[str, Any]) -> float:
    return result["reached"]["mean"] / result["goals"]


def _merit(result: Mapping[str, Any]) -> tuple[float, float]:
    error = result["error_at_goals"]
    return _share(result), -error["mean"] if error else -np.inf
