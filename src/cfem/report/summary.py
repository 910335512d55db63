"""What a page says first: whether the result is good, and the three numbers that matter."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.control.spec import FE_BASED
from cfem.report.page import Number, Summary
from cfem.report.tables import number
from cfem.report.tracking import Tracking

LOSS, FAILED = 1e-2, 0.05  # above these a model and a dataset are poor


def tracking_summary(
    found: Tracking, models: Mapping[str, Mapping[str, Any]], sampled: Mapping[str, Any], discretisation: float | None
) -> Summary:
    """Of the first learned controller, on all trajectories. models: results of `cfem train` by name; sampled: of `cfem
    simulate-sample`; discretisation: mm, distance of the tip of this mesh from that of a finer one, None where it was
    not measured."""
    parts = [(name, found.learned(name)) for name in found.summaries]
    who = parts[0][1]
    goals = sum(found.summaries[name][one]["goals"] for name, one in parts)
    rows = [found.of(name, one) for name, one in parts]
    judged = [found.of(name, FE_BASED if FE_BASED in found.summaries[name] else one) for name, one in parts]
    reachable = np.concatenate([one["reachable"] for one in judged])
    error = np.concatenate([one["error"] for one in rows])
    reached, limit = int((error[reachable] <= found.spec["reached"]).sum()), found.spec["reached"]
    able, away = int(reachable.sum()), goals - int(reachable.sum())
    concerns = []
    if reached < able:
        concerns.append(f"{who} misses {able - reached} of the {able} goals in reach by more than {number(limit)} mm.")
    if not able:
        concerns.append(f"none of the {goals} goals is in reach of the robot.")
    outside = sum(int((~one["inside"][can["reachable"]]).sum()) for one, can in zip(rows, judged, strict=True))
    if outside and found.plant != "fem":  # where FE judges, the tracking error says what that is worth
        concerns.append(f"plans for {outside} goals in reach lie outside the states that {who} was trained on.")
    if discretisation is not None and discretisation > limit:
        concerns.append(
            f"the discretisation error, {number(discretisation, 2)} mm, exceeds the {number(limit)} mm within which a "
            "goal counts as reached: refine the mesh."
        )
    concerns += _upstream(models, sampled)
    known = error[reachable & np.isfinite(error)]
    plant = "finite-element robot" if found.plant == "fem" else "model"
    sentence = f"The {plant} reaches {reached} of {able} goals in reach with the learned model {who}."
    if away:
        sentence += f" {away} goal{'s lie' if away > 1 else ' lies'} out of its reach; it ends at the nearest point."
    numbers = [Number(f"{reached} of {able}", "goals reached", f"within {number(limit)} mm" + _away(away))]
    if len(known):
        numbers.append(Number(f"{number(known.mean(), 2)} mm", "mean tracking error", _beside(known, discretisation)))
    numbers.append(_time(found, rows))
    return Summary(sentence, tuple(concerns), tuple(numbers))


def _away(away: int) -> str:
    return f"; {away} more out of reach" if away else ""


def _beside(error: np.ndarray, discretisation: float | None) -> str:
    text = f"largest {number(error.max(), 2)} mm, on the same mesh. "
    if discretisation is None:
        return text + "The discretisation error was not measured."
    return text + f"Discretisation error of the tip: {number(discretisation, 2)} mm."


def _time(found: Tracking, rows: Sequence[Mapping[str, np.ndarray]]) -> Number:
    """Per control step, beside an FE solve."""
    step = float(np.median(np.concatenate([one["step_us"] for one in rows]))) / 1000
    note = ""
    if found.fe_seconds:
        solve = 1000 * found.fe_seconds
        shown = f"{number(solve)} ms" if solve < 1000 else f"{number(solve / 1000)} s"
        note = f"an FE solve of this robot takes {shown}: {number(solve / step, 2)} times longer"
    return Number(f"{number(step)} ms", "per control step (median)", note)


def _upstream(models: Mapping[str, Mapping[str, Any]], sampled: Mapping[str, Any]) -> list[str]:
    """What is poor about the models and about their samples."""
    found = [
        f"the loss of model {name} is {number(one['errors']['loss'], 2)}, above {LOSS:g}: train on more samples."
        for name, one in models.items()
        if not one["errors"]["loss"] <= LOSS
    ]
    failed, rows = sampled.get("failed", 0), sum(sampled.get("rows", {}).values())
    if failed > FAILED * (failed + rows):
        found.append(f"{failed} of {failed + rows} sampled states did not converge.")
    return found


def loops_summary(loops: Mapping[str, Mapping[str, Mapping[str, dict]]]) -> Summary:
    """loops: results of `cfem control` over time, by their names: goals of the best controller of each run."""
    runs = [(name, one) for name, trajectories in loops.items() for one in trajectories.values()]
    best = [(name, *max(one.items(), key=lambda item: _share(item[1]))) for name, one in runs]
    poor = [one for one in best if _share(one[2]) < 1]
    concerns = [
        f"in {name} no controller reaches all goals; the best, {who}, reaches {_goals(one)}." for name, who, one in poor
    ]
    if len(best) > 1:
        sentence = f"In {len(best) - len(poor)} of {len(best)} runs over time a controller reaches every goal."
        return Summary(sentence, tuple(concerns))
    ((_, who, one),) = best
    sentence = f"Controller {who} reaches {_goals(one)} goals over time."
    numbers = [Number(_goals(one), "goals reached", f"by controller {who}, the best of the run")]
    if one["error_at_goals"]:
        mean, largest = (f"{number(one['error_at_goals'][key], 2)} mm" for key in ("mean", "max"))
        numbers.append(Number(mean, "mean error when the next goal was due", f"largest {largest}"))
    numbers.append(Number(f"{number(one['step_us']['median'] / 1000)} ms", "CPU per tick (median)"))
    return Summary(sentence, tuple(concerns), tuple(numbers))


def _goals(one: Mapping[str, Any]) -> str:
    return f"{one['reached']['mean']:g} of {one['goals']}"


def _share(one: Mapping[str, Any]) -> float:
    return one["reached"]["mean"] / one["goals"]
