"""The task of a spec solved, and what is said of it."""

import time
from pathlib import Path
from typing import Any

import numpy as np

from cfem.condensed.parameters import named, units_of
from cfem.core.artefact.judgement import DESIGN_GAP, contradicted
from cfem.core.console.shown import duration
from cfem.design.answer import parameters
from cfem.design.formulation import free_parameters
from cfem.design.spec import DesignSpec
from cfem.design.task import serve


def serve_and_tell(
    spec: DesignSpec, task: Any, family: Any, exact: Any, outcome: dict[str, Any], base: Path
) -> dict[str, Any]:
    """Results of the task; base: folder of the spec. Lines go into outcome["headline"], and findings into
    outcome["judgement"] where finite elements contradict the model."""
    free, p0 = free_parameters(spec, family.parameters)
    goals, force, matter = task.goals, task.force[0], task.weights > 0
    begin = time.process_time()
    before = serve(family, task, [], p0, spec.task.starts)
    served = serve(family, task, free, p0, spec.task.starts)
    seconds = time.process_time() - begin
    results: dict[str, Any] = {"seconds": seconds, "evaluations": before.evaluations + served.evaluations}
    for name, solution in (("reference", before), ("found", served)):
        results[name] = {
            "p": named(family.parameters, solution.p),
            "delta_a": solution.u,
            "lambda_a": solution.states.lam,
            "distance": solution.distance,
            "pushing_states": int((solution.states.lam < -1e-9).any(axis=1).sum()),
            "outside": family.outside(solution.states),
        }
    rms = [_rms(solution.distance) for solution in (before, served)]
    values = parameters(results["found"]["p"], units_of(family.parameters))
    line = f"task: {values} reaches {len(goals)} goals to {rms[1]:.3g} mm (rms), the reference to {rms[0]:.3g} mm"
    if exact:
        # the force as a dead load, not to first order
        states = exact.at("displacement", served.u, np.tile(served.p, (len(goals), 1)), force if force.any() else None)
        place = states.delta_e if task.from_rest else states.x_e
        apart = np.linalg.norm((place - goals)[:, matter], axis=1)
        results["found"]["fe_distance"] = apart
        exactly = _rms(apart)
        line += f", by finite elements {exactly:.3g} mm"
        if exactly > rms[0] and exactly - rms[1] > DESIGN_GAP * rms[0]:
            better = f"finite elements reach the goals to {exactly:.3g} mm, the model to {rms[1]:.3g} mm"
            outcome["judgement"].append(contradicted(f"task: {better}; the reference design is no worse"))
    outcome["headline"].append(line)
    if spec.task.policy:
        results["policy"], lines = _by_policy(spec, task, family, exact, base, {"task": served.p, "reference": p0})
        outcome["headline"] += lines
    return results


def _by_policy(
    spec: DesignSpec, task: Any, family: Any, exact: Any, base: Path, designs: dict[str, np.ndarray]
) -> tuple[dict[str, Any], list[str]]:
    """Results and lines: what the policy does with the design that it does best with, and with these (n_p,)."""
    from cfem.design.by_policy import ByPolicy
    from cfem.gym.policy import Policy

    free, p0 = free_parameters(spec, family.parameters)
    begin = time.process_time()
    judge = ByPolicy(family, task, Policy(base / spec.task.policy), p0, free)
    stated = np.array(list(designs.values()))
    judged = {by: judge.best(stated, by) for by in ("reward", "distance")}
    judged |= {name: judge.at(p) for name, p in designs.items()}
    results: dict[str, Any] = {"seconds": time.process_time() - begin, "steps": judge.steps, "ticks": judge.ticks}
    lines = [f"policy: {judge.steps} ticks of episodes, in {duration(results['seconds'])} of CPU time"]
    for name, judgement in judged.items():
        results[name] = {
            "p": named(family.parameters, judgement.p),
            "reward": judgement.reward,
            "distance": judgement.distance,
        }
        line = f"{TITLES[name]}: reward {judgement.reward:.4f}, {_rms(judgement.distance):.3g} mm at the end (rms)"
        if exact:
            checked = judge.in_fe(
                judgement.p, exact.meshes.of(judgement.p[[not parameter.exact for parameter in family.parameters]])[1]
            )
            results[name] |= {"fe_reward": checked.reward, "fe_distance": checked.distance}
            line += f", by finite elements {checked.reward:.4f} and {_rms(checked.distance):.3g} mm"
        lines.append(line)
    units = units_of(family.parameters)
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
