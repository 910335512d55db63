"""The task of a spec solved, and what is said of it."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.artefact.judgement import DESIGN_GAP, contradicted
from cfem.core.console.shown import duration
from cfem.design.answer import parameters
from cfem.design.formulation import free_parameters
from cfem.design.spec import DesignSpec
from cfem.design.task import serve


def serve_and_tell(
    spec: DesignSpec, asked: Any, family: Any, exact: Any, said: dict[str, Any], base: Path
) -> dict[str, Any]:
    """base: folder of the spec.

    Results; lines into said["headline"], and into said["judgement"] where finite elements contradict the model."""
    free, p0 = free_parameters(spec, family.parameters)
    goals, force, matter = asked.goals, asked.force[0], asked.weights > 0
    begin = time.process_time()
    before = serve(family, asked, [], p0, spec.task.starts)
    found = serve(family, asked, free, p0, spec.task.starts)
    seconds = time.process_time() - begin
    results: dict[str, Any] = {"seconds": seconds, "evaluations": before.evaluations + found.evaluations}
    for name, one in (("reference", before), ("found", found)):
        results[name] = {
            "p": dict(zip([parameter.name for parameter in family.parameters], one.p, strict=True)),
            "delta_a": one.u,
            "lambda_a": one.states.lam,
            "distance": one.distance,
            "pushing_states": int((one.states.lam < -1e-9).any(axis=1).sum()),
            "outside": family.outside(one.states),
        }
    rms = [_rms(one.distance) for one in (before, found)]
    units = {one.name: one.unit for one in family.parameters if one.unit != "1"}
    values = parameters(results["found"]["p"], units)
    line = f"task: {values} reaches {len(goals)} goals to {rms[1]:.3g} mm (rms), the reference to {rms[0]:.3g} mm"
    if exact:
        # the force as a dead load, not to first order
        there = exact.at("displacement", found.u, np.tile(found.p, (len(goals), 1)), force if force.any() else None)
        place = there.delta_e if asked.from_rest else there.x_e
        apart = np.linalg.norm((place - goals)[:, matter], axis=1)
        results["found"]["fe_distance"] = apart
        exactly = _rms(apart)
        line += f", by finite elements {exactly:.3g} mm"
        if exactly > rms[0] and exactly - rms[1] > DESIGN_GAP * rms[0]:
            better = f"finite elements reach the goals to {exactly:.3g} mm, the model to {rms[1]:.3g} mm"
            said["judgement"].append(contradicted(f"task: {better}; the reference design is no worse"))
    said["headline"].append(line)
    if spec.task.policy:
        results["policy"], lines = _by_policy(spec, asked, family, exact, base, {"task": found.p, "reference": p0})
        said["headline"] += lines
    return results


def _by_policy(
    spec: DesignSpec, asked: Any, family: Any, exact: Any, base: Path, others: dict[str, np.ndarray]
) -> tuple[dict[str, Any], list[str]]:
    """Results and lines: what the policy does with the design that it does best with, and with the others (n_p,)."""
    from cfem.design.by_policy import ByPolicy
    from cfem.gym.policy import Policy

    free, p0 = free_parameters(spec, family.parameters)
    begin = time.process_time()
    judge = ByPolicy(family, asked, Policy(base / spec.task.policy), p0, free)
    given = np.array(list(others.values()))
    judged = {by: judge.best(given, by) for by in ("reward", "distance")}
    judged |= {name: judge.at(p) for name, p in others.items()}
    results: dict[str, Any] = {"seconds": time.process_time() - begin, "steps": judge.steps, "ticks": judge.ticks}
    lines = [f"policy: {judge.steps} ticks of episodes, in {duration(results['seconds'])} of CPU time"]
    for name, one in judged.items():
        results[name] = {
            "p": dict(zip([parameter.name for parameter in family.parameters], one.p, strict=True)),
            "reward": one.reward,
            "distance": one.distance,
        }
        line = f"{TITLES[name]}: reward {one.reward:.4f}, {_rms(one.distance):.3g} mm at the end (rms)"
        if exact:
            checked = judge.in_fe(one.p, exact.meshes.of(one.p[[not it.exact for it in family.parameters]])[1])
            results[name] |= {"fe_reward": checked.reward, "fe_distance": checked.distance}
            line += f", by finite elements {checked.reward:.4f} and {_rms(checked.distance):.3g} mm"
        lines.append(line)
    units = {one.name: one.unit for one in family.parameters if one.unit != "1"}
    lines += [f"{TITLES[by]}: {parameters(results[by]['p'], units)}" for by in ("reward", "distance")]
    return results, lines


TITLES = {
    "reward": "policy's design of the largest reward",
    "distance": "policy's design of the least distance",
    "task": "policy with the task's design",
    "reference": "policy with the reference",
}


def _rms(distance: np.ndarray) -> float:
    return float(np.sqrt(np.mean(distance**2)))
