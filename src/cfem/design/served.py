"""The task of a spec solved, and what is said of it."""

import time
from typing import Any

import numpy as np

from cfem.core.judgement import DESIGN_GAP, contradicted
from cfem.design.formulation import free_parameters
from cfem.design.spec import DesignSpec
from cfem.design.task import serve


def serve_and_tell(spec: DesignSpec, asked: Any, family: Any, exact: Any, said: dict[str, Any]) -> dict[str, Any]:
    """Results; lines into said["headline"], and into said["judgement"] where finite elements contradict the model."""
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
    rms = [float(np.sqrt((one.distance**2).mean())) for one in (before, found)]
    values = ", ".join(f"{key} {value:.4g}" for key, value in results["found"]["p"].items())
    line = f"task: {values} reaches {len(goals)} goals to {rms[1]:.3g} mm (rms), the reference to {rms[0]:.3g} mm"
    if exact:
        # the force as a dead load, not to first order
        there = exact.at("displacement", found.u, np.tile(found.p, (len(goals), 1)), force if force.any() else None)
        place = there.delta_e if asked.from_rest else there.x_e
        apart = np.linalg.norm((place - goals)[:, matter], axis=1)
        results["found"]["fe_distance"] = apart
        exactly = float(np.sqrt((apart**2).mean()))
        line += f", by finite elements {exactly:.3g} mm"
        if exactly > rms[0] and exactly - rms[1] > DESIGN_GAP * rms[0]:
            better = f"finite elements reach the goals to {exactly:.3g} mm, the model to {rms[1]:.3g} mm"
            said["judgement"].append(contradicted(f"task: {better}; the reference design is no worse"))
    said["headline"].append(line)
    return results
