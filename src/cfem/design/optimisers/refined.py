"""Each best design of the model brought to an optimum by finite elements (trust_region.py), from several starts; and
what is said of it."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed.parameters import named
from cfem.core.artefact.judgement import contradicted
from cfem.core.console.shown import duration
from cfem.core.errors import NumericalError
from cfem.design.fe import FeProblem
from cfem.design.objectives import with_unit
from cfem.design.optimisers.search import Grid, Scalar, best, starts_apart
from cfem.design.optimisers.trust_region import Optimum, TrustRegionSettings, best_of, optimum
from cfem.design.problem import DesignProblem
from cfem.design.spec import DesignSpec

_SAME = 0.02  # of a range: ends of two starts that count as one optimum


@dataclass(frozen=True)
class Refined:
    """Optima by finite elements from several starts."""

    best: Optimum  # of `ends`
    ends: list[Optimum]  # one a start that finite elements solve
    seconds: float  # CPU time

    @property
    def agree(self) -> int:
        """Number of starts that ended at the best design."""
        return sum(bool(np.abs(end.z - self.best.z).max() <= _SAME) for end in self.ends)


def refine_all(spec: DesignSpec, problem: DesignProblem, exact: FeProblem, grid: Grid) -> dict[str, Refined]:
    """Refined designs by objective and blend. exact: the same problem by finite elements. NumericalError where they
    solve no start."""
    refine = spec.refine
    limits = TrustRegionSettings(refine.radius, refine.tolerance, refine.solves)
    rows = dict(zip(problem.names, np.eye(len(problem.names)), strict=True))
    for name, weights in spec.blends.items():
        rows[name] = np.array([weights.get(objective, 0.0) for objective in problem.names])
    return {name: _refined(problem, exact, grid, weights, refine.starts, limits) for name, weights in rows.items()}


def _refined(
    problem: DesignProblem, exact: FeProblem, grid: Grid, weights: np.ndarray, starts: int, limits: TrustRegionSettings
) -> Refined:
    """Refined design of several starts, the best of the model and others that lie apart. NumericalError where finite
    elements solve none of them."""
    begin, scalar = time.process_time(), Scalar.weighted(weights)
    first = best(problem, grid, scalar, starts)
    chosen = [first.z]
    for z in starts_apart(grid, scalar, 4 * starts):
        if len(chosen) < starts and all(np.abs(z - start).max() > _SAME for start in chosen):
            chosen.append(z)
    ends, error = [], None
    for z in chosen:
        try:
            ends.append(optimum(problem, exact, grid, weights, z, limits))
        except NumericalError as failed:
            error = failed
    if not ends:
        raise NumericalError(f"finite elements solve none of the {len(chosen)} designs to start from: {error}")
    return Refined(best_of(ends), ends, time.process_time() - begin)


def account_of(
    problem: DesignProblem, refined_by_name: dict[str, Refined]
) -> tuple[dict[str, Any], list[str], list[Any]]:
    """Results for design.json, lines for a person, and findings where a search did not end at an optimum."""
    results, lines, doubts = {}, [], []
    for name, refined in refined_by_name.items():
        top, shown = refined.best, [name] if name in problem.names else problem.names
        p = problem.p(top.z)
        parameters = problem.family.parameters
        results[name] = {
            "p": named(parameters, p),
            "overrides": [parameter.override(value) for parameter, value in zip(parameters, p, strict=True)],
            "objectives": dict(zip(problem.names, top.objectives.tolist(), strict=True)),
            "constraints": dict(zip(problem.constraints, top.constraints.tolist(), strict=True)),
            "of_the_models_design": dict(zip(problem.names, refined.ends[0].first.tolist(), strict=True)),
            "residual": top.residual,
            "certified": top.certified,
            "why": top.why,
            "starts": [
                {"value": end.value, "certified": end.certified, "solves": end.solves, "why": end.why}
                for end in refined.ends
            ],
            "starts_that_agree": refined.agree,
            "seconds": refined.seconds,
        }
        values = ", ".join(_pair(problem, key, top.objectives, refined.ends[0].first) for key in shown)
        solves = sum(end.solves for end in refined.ends)
        lines.append(
            f"{name} by finite elements (the model's best design in brackets): {values}; "
            f"{'an optimum' if top.certified else 'no optimum: ' + top.why}, first-order residual {top.residual:.1e}; "
            f"{refined.agree} of {len(refined.ends)} starts, {solves} solves, {duration(refined.seconds)} of CPU time"
        )
        if not top.held:
            doubts.append(contradicted(f"design {name}: its constraints do not hold by finite elements"))
    return results, lines, doubts


def _pair(problem: DesignProblem, key: str, fe: np.ndarray, model: np.ndarray) -> str:
    """An objective by finite elements, and in brackets that of the model's best design."""
    i, objective = problem.names.index(key), problem.objectives[key]
    return f"{key} {with_unit(objective, fe[i])} ({with_unit(objective, model[i])})"
