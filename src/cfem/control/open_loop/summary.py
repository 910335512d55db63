"""Rows of the table and numbers of the headline, from tracked goals."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cfem.control.open_loop.experiment import Tracked
from cfem.control.search.optimality import Verdict
from cfem.control.task.obstacles.world import ObstacleWorld
from cfem.control.task.run_spec import FE_BASED
from cfem.core.artefact.judgement import poor
from cfem.core.console.shown import counted, duration, length

JUDGED = {"fem": "on the mesh of the model", "model": "by the model alone"}  # what an error is of, by plant


def record(
    trajectory: str,
    tracked: Tracked,
    reached: float,
    fe: Tracked | None,
    world: ObstacleWorld | None = None,
    reached_rotation: float = np.inf,
    been_there: bool = False,
) -> dict:
    """Row of `trajectories.parquet`; lengths mm, forces N. Of robots that hold an object it has `contact`: the force by
    which each of them pushes it, by the plan.

    fe: what FE-based control did at the same goal
    world: of obstacles, whose wanted forces and distances belong to a goal
    reached_rotation: rad
    been_there: whether the goal is a state of the robot within the bounds of the search, and cannot be out of reach"""
    plan, measured = tracked.plan, tracked.measured
    near = plan.distance < reached and (world is None or world.met(plan.delta_e, reached))
    verdict = plan.verdict(near)
    if been_there and verdict is Verdict.OUT_OF_REACH:
        verdict = Verdict.MISPLACED
    turned = tracked.rotation_error
    pushes = getattr(plan.iterate.condensed, "forces", None)
    return {
        **({} if pushes is None else {"contact": pushes.ravel()}),
        **({} if turned is None else {"rotation_error": np.degrees(turned)}),
        "trajectory": trajectory,
        "controller": tracked.controller,
        "goal_index": tracked.index,
        "goal": tracked.goal,
        "x_e": measured.x_e,
        "error": tracked.error,
        "error_to_fe_based": float(np.linalg.norm(measured.x_e - fe.measured.x_e)) if fe else float("nan"),
        "delta_a": plan.delta_a,
        "lambda_a": plan.lambda_a,
        "predicted_e": plan.delta_e,
        "predicted_distance": plan.distance,
        "verdict": verdict.value,
        "reachable": verdict is not Verdict.OUT_OF_REACH,
        "reached": tracked.error < reached
        and (turned is None or turned < reached_rotation)
        and (world is None or world.met(measured.x_e, reached)),
        "inside": tracked.inside,
        "distance_to_data": tracked.distance,
        "model_error": np.nan if plan.model_error is None else plan.model_error,
        **({} if world is None else {"force_error": _force_error(plan.iterate.condensed)}),
        "status": plan.status.value,
        "plant_status": measured.status,
        "iterations": plan.iterations,
        "queries": plan.queries,
        "softened": plan.softened,
        "kkt": plan.kkt,
        "seconds": plan.seconds,
        "step_us": 1e6 * plan.seconds / max(plan.iterations, 1),
    }


def _force_error(condensed: Any) -> float:
    """N, bound of the error of the force of each obstacle; NaN where none is stated."""
    bounds = getattr(condensed, "bounds", None)
    return np.nan if bounds is None else bounds.force


def summarise(records: Sequence[dict], length: float, counted: Sequence[str] | None = None) -> dict:
    """Headline of one trajectory: per controller, distances in mm and % of length, step times in us, shares. counted:
    the effector rows of the distances, None for all that goals are set for.

    A goal counts as reachable unless FE-based control has shown that it is not, or the controller itself where
    FE-based did not run, and as reached where the plant ended near it."""
    by_controller: dict[str, list[dict]] = {}
    for row in records:
        by_controller.setdefault(row["controller"], []).append(row)
    judge = by_controller.get(FE_BASED)
    results = {}
    for name, rows in by_controller.items():
        reachable = [row["reachable"] for row in (judge or rows)]
        near = [row["error"] for row, can in zip(rows, reachable, strict=True) if can]
        far = [row["error"] for row, can in zip(rows, reachable, strict=True) if not can]
        results[name] = {
            "goals": len(rows),
            "counted": None if counted is None else list(counted),
            "reachable": sum(reachable),
            "reached": sum(row["reached"] for row in rows),
            "missed": sum(can and not row["reached"] for row, can in zip(rows, reachable, strict=True)),
            "not_converged": sum(row["verdict"] == Verdict.NOT_CONVERGED.value for row in rows),
            "misplaced": sum(row["verdict"] == Verdict.MISPLACED.value for row in rows),
            "converged": sum(row["status"] == "converged" for row in rows),
            "plant_converged": sum(row["plant_status"] == "converged" for row in rows),
            "inside": sum(row["inside"] for row in rows),
            "softened": sum(row["softened"] for row in rows),
            "distance_to_reachable_goals": _spread(near, length),
            "distance_to_unreachable_goals": _spread(far, length),
            "distance_to_fe_based": None
            if name == FE_BASED
            else _spread([row["error_to_fe_based"] for row in rows], length),
            "rotation_error": _of_rotations(rows),
            "iterations_mean": float(np.mean([row["iterations"] for row in rows])),
            "step_us": {
                "median": float(np.median([row["step_us"] for row in rows])),
                "p99": float(np.percentile([row["step_us"] for row in rows], 99)),
            },
            "kkt_max": max(row["kkt"] for row in rows),
        }
    return results


def headline(
    trajectories: dict[str, dict],
    discretisation: dict | None = None,
    fe_cost: dict | None = None,
    plant: str = "fem",
) -> list[str]:
    """One sentence per trajectory and controller, those with fewer iterations (name@n) left to the tables, and one on
    the discretisation error, which comes first where it is larger than all distances to goals. plant: of the spec."""
    lines = []
    for trajectory, controllers in trajectories.items():
        for name, row in controllers.items():
            if "@" not in name:
                lines.append(f"{trajectory}, {name}: " + "; ".join(_parts(row, fe_cost, plant)))
    if discretisation is None:
        return lines
    sentence = discretisation_sentence(discretisation)
    errors = [
        row[f"distance_to_{what}_goals"]
        for controllers in trajectories.values()
        for row in controllers.values()
        for what in ("reachable", "unreachable")
    ]
    tracking = max((error["max"] for error in errors if error), default=0.0)
    return [sentence, *lines] if discretisation.get("tip_mm", 0.0) > tracking else [*lines, sentence]


def judged(trajectories: Mapping[str, dict], beyond: Mapping[str, bool]) -> list[dict]:
    """Findings that make a run poor: searches that ended anywhere, goals that the model takes for out of reach where
    the robot has been, and goals that are missed for the most part. beyond:
    of a trajectory, whether goals out of reach are meant, which then do not count. Those with fewer iterations (name@n)
    are left out."""
    findings = []
    for trajectory, controllers in trajectories.items():
        for name, row in controllers.items():
            if "@" in name:
                continue
            who, goals, out = f"{trajectory}, {name}", row["goals"], row["goals"] - row["reachable"]
            lost, missed = row["not_converged"], goals - row["reached"]
            if lost:
                sentence = (
                    f"{who}: the search for {lost} of {goals} goals did not converge, and nothing is known of them"
                )
                findings.append(
                    poor(f"{sentence}; check search.step, tolerance and regularisation, or allow more iterations")
                )
            if row["misplaced"]:
                findings.append(
                    poor(
                        f"{who}: the model takes {row['misplaced']} of {goals} goals for out of reach, and the robot "
                        "has been there: it errs where they are; sample more states, or a smaller reach"
                    )
                )
            if 2 * (row["missed"] if beyond[trajectory] else missed) > (
                row["reachable"] if beyond[trajectory] else goals
            ):
                findings.append(
                    poor(f"{who}: {missed} of {goals} goals are missed, and {out} of them are out of reach")
                )
    return findings


def discretisation_sentence(error: dict) -> str:
    """Sentence about what the mesh itself leaves uncertain."""
    if "left_out" in error:
        return f"discretisation error: not estimated ({error['left_out']})"
    states = f"{error['states']} state{'s' * (error['states'] > 1)}"
    return (
        f"discretisation error: the mesh itself leaves up to {length(error['tip_mm'], digits=2)} uncertain at the tip "
        f"({error['tip_percent']:.2g} % of the length), {error['force_percent']:.2g} % of the actuator forces and "
        f"{error['reach_percent']:.2g} % of the reach (estimated: rest and {states} "
        f"on {error['finer_cells']} instead of {error['cells']} cells)"
    )


def _parts(row: dict, fe_cost: dict | None, plant: str) -> list[str]:
    """Parts of the sentence about one controller on one trajectory."""
    near, far, fe = (row[f"distance_to_{what}"] for what in ("reachable_goals", "unreachable_goals", "fe_based"))
    parts = [f"{row['reached']} of {row['goals']} goals reached"]
    if near:
        weighted = row["counted"]
        what = "" if weighted is None else f" of {', '.join(weighted) or 'no place'} alone (search.weights)"
        parts.append(f"tracking error{what} mean {length(near['mean'])}, max {length(near['max'])}, {JUDGED[plant]}")
    if row.get("rotation_error"):
        parts.append("orientation error mean {mean:.2g} deg, max {max:.2g} deg".format(**row["rotation_error"]))
    if far:
        out = row["goals"] - row["reachable"]
        goals = f"{counted(out, 'goal is', 'goals are')} out of reach: the robot ended"
        how_far = f" on average, {length(far['max'])} at most" if out > 1 else ""
        parts.append(f"{goals} {length(far['mean'])} away{how_far}")
    if row["not_converged"]:
        parts.append(f"the search for {row['not_converged']} of them did NOT CONVERGE")
    if fe:
        parts.append(f"mean {length(fe['mean'])}, max {length(fe['max'])} from FE-based control")
    step = f"{duration(1e-6 * row['step_us']['median'])} per control step"
    if fe_cost and fe_cost["solves"]:
        step += f" (an FE solve takes {duration(fe_cost['seconds'] / fe_cost['solves'])})"
    parts.append(step)
    if row["inside"] < row["goals"]:
        outside = row["goals"] - row["inside"]
        parts.append(f"{outside} plan{'s' * (outside > 1)} OUTSIDE what the model was trained on")
    return parts


def _of_rotations(rows: Sequence[dict]) -> dict | None:
    """Mean and largest in degrees; None where no goal states an orientation, failed plant steps left out."""
    known = np.array([row["rotation_error"] for row in rows if np.isfinite(row.get("rotation_error", np.nan))])
    return {"mean": float(known.mean()), "max": float(known.max())} if len(known) else None


def _spread(values: Sequence[float], length: float) -> dict | None:
    """Mean and largest in mm and in % of length; None where there are none, failed plant steps (NaN) left
    out."""
    known = np.array([value for value in values if np.isfinite(value)])
    if not len(known):
        return None
    mean, largest = float(known.mean()), float(known.max())
    return {"mean": mean, "max": largest, "mean_percent": 100 * mean / length, "max_percent": 100 * largest / length}
