"""What a page says first: whether the result is good, and the three numbers that matter."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.control.run_spec import FE_BASED
from cfem.control.search.optimality import Verdict
from cfem.core.console.shown import duration, length, times
from cfem.report.page import Number, Summary
from cfem.report.sections.tracking import Tracking


@dataclass(frozen=True)
class Outcome:
    """Of one controller on all trajectories, by goal: error (m,) mm, NaN where the robot failed; reachable (m,) where
    nothing shows that it is out of reach, and converged (m,) whether the search ended at an optimum, both by FE-based
    control where it ran; inside (m,) whether the plan stayed within what the model was trained on; step_us (m,)."""

    who: str
    error: np.ndarray
    reachable: np.ndarray
    converged: np.ndarray
    inside: np.ndarray
    step_us: np.ndarray

    @classmethod
    def of(cls, found: Tracking) -> "Outcome":
        """Of the first learned controller."""
        parts = [(name, found.learned(name)) for name in found.summaries]
        rows = [found.of(name, who) for name, who in parts]
        judged = [found.of(name, FE_BASED if FE_BASED in found.summaries[name] else who) for name, who in parts]
        own = [np.concatenate([one[key] for one in rows]) for key in ("error", "inside", "step_us")]
        reachable = np.concatenate([one["reachable"] for one in judged])
        converged = np.concatenate([np.asarray(one["verdict"]) != Verdict.NOT_CONVERGED.value for one in judged])
        return cls(parts[0][1], own[0], reachable, converged, *own[1:])


def tracking_summary(found: Tracking) -> Summary:
    """Of the first learned controller, judged by the robot."""
    one, limit = Outcome.of(found), found.spec["reached"]
    able, reached = int(one.reachable.sum()), int((one.error[one.reachable] <= limit).sum())
    away = len(one.error) - able
    plant = "finite-element robot" if found.plant == "fem" else "model"
    known = "goals within reach" if one.converged.all() else "goals that are not shown to be out of reach"
    sentence = f"The {plant} reaches {reached} of {able} {known}, driven by the learned model '{one.who}'."
    if away:
        sentence += f" {away} goal{'s lie' if away > 1 else ' lies'} out of its reach: it ends at the nearest point."
    within = (f"within {length(limit)}", *((f"{away} more out of reach",) if away else ()))
    numbers = [Number(f"{reached} of {able}", "goals reached", within)]
    known = one.error[one.reachable & np.isfinite(one.error)]
    if len(known):
        mesh = (found.discretisation or {}).get("tip_mm", 0.0)
        if mesh > known.max():
            sentence += (
                f" The mesh itself leaves {length(mesh, digits=2)} uncertain at the tip, more than the tracking error."
            )
        numbers.append(Number(length(known.mean()), "mean tracking error", _beside(known, found)))
    numbers.append(_time(found, one.step_us))
    return Summary(sentence, tuple(_concerns(one, found, reached)), tuple(numbers))


def _concerns(one: Outcome, found: Tracking, reached: int) -> Iterator[str]:
    able, limit = int(one.reachable.sum()), found.spec["reached"]
    lost = int((~one.converged).sum())
    if lost:
        yield f"the search for {lost} of {len(one.error)} goals did not converge"
    if reached < able:
        yield f"{one.who} misses {able - reached} of the {able} goals in reach by more than {length(limit)}"
    if not able:
        yield f"none of the {len(one.error)} goals is in reach of the robot"
    outside = int((one.reachable & ~one.inside).sum())
    if outside and found.plant != "fem":  # where FE judges, the tracking error says what that is worth
        yield f"plans for {outside} goals in reach lie outside the states that {one.who} was trained on"


def _beside(error: np.ndarray, found: Tracking) -> tuple[str, str]:
    """What to hold beside the mean tracking error."""
    text, mesh = f"largest {length(error.max())}, on the mesh of the model", found.discretisation or {}
    if "tip_mm" in mesh:
        return text, f"discretisation error of the tip: {length(mesh['tip_mm'], digits=2)} (estimated)"
    why = f": {mesh['left_out']}" if "left_out" in mesh else ""
    return text, f"discretisation error: not estimated{why}"


def _time(found: Tracking, step_us: np.ndarray) -> Number:
    """Per control step, beside an FE solve."""
    step, solve, name = 1e-6 * float(np.median(step_us)), found.fe_seconds, "per control step (median)"
    if not solve:
        return Number(duration(step), name)
    note = f"one FE solve of this robot takes {duration(solve)}, {times(solve / step)} times as long"
    return Number(duration(step), name, (note,))


def loops_summary(loops: Mapping[str, Mapping[str, Mapping[str, dict]]]) -> Summary:
    """loops: results of `cfem control` over time, by their names: goals of the best controller of each run, of several
    that reach as many the one with the smallest error."""
    runs = [(name, one) for name, trajectories in loops.items() for one in trajectories.values()]
    best = [(name, *max(one.items(), key=lambda item: _merit(item[1]))) for name, one in runs]
    poor = [one for one in best if _share(one[2]) < 1]
    concerns = [
        f"in {name} no controller reaches all goals; the best, {who}, reaches {_goals(one)}" for name, who, one in poor
    ]
    if len(best) > 1:
        reached = len(best) - len(poor)
        sentence = f"In {reached} of {len(best)} runs over time at least one controller reaches every goal."
        return Summary(sentence, tuple(concerns))
    ((_, who, one),) = best
    sentence = f"Controller {who} reaches {_goals(one)} goals over time."
    numbers = [Number(_goals(one), "goals reached", (f"by controller {who}, the best of the run",))]
    if one["error_at_goals"]:
        mean, largest = (length(one["error_at_goals"][key]) for key in ("mean", "max"))
        numbers.append(Number(mean, "mean error when the next goal was due", (f"largest {largest}",)))
    numbers.append(Number(duration(1e-6 * one["step_us"]["median"]), "CPU time per tick (median)"))
    return Summary(sentence, tuple(concerns), tuple(numbers))


def _goals(one: Mapping[str, Any]) -> str:
    return f"{one['reached']['mean']:g} of {one['goals']}"


def _share(one: Mapping[str, Any]) -> float:
    return one["reached"]["mean"] / one["goals"]


def _merit(one: Mapping[str, Any]) -> tuple[float, float]:
    error = one["error_at_goals"]
    return _share(one), -error["mean"] if error else -np.inf
