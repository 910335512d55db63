"""Sensitivity to parameters: shares of the variance of an objective over all designs (Sobol 2001).

The first share of a parameter is what it explains alone, the total share what it explains with all others: what would
be left of the variance if all others were known. Evenly spread designs, scrambled Sobol points; estimators of Saltelli
et al. (Comput. Phys. Commun. 181, 2010), by scipy.stats.sobol_indices."""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.stats import sobol_indices, uniform

from cfem.core.errors import NumericalError
from cfem.design.problem import DesignProblem

_SHOWN = 4  # parameters that the line names


def shares(values_of: Callable[[np.ndarray], np.ndarray], n: int, designs: int) -> dict[str, np.ndarray]:
    """Sobol indices `first` and `total`, (k, n) each, of values_of: (m, n) in [0, 1] -> (m, k). NumericalError where a
    value is not finite.

    designs: a power of two; costs designs (n + 2) evaluations"""

    def values(z: np.ndarray) -> np.ndarray:
        values = values_of(z.T).T
        if not np.isfinite(values).all():
            raise NumericalError("an objective is not finite at some designs", where="sensitivity")
        return values

    sobol = sobol_indices(func=values, n=designs, dists=[uniform()] * n, rng=np.random.default_rng(0))
    return {"first": np.atleast_2d(sobol.first_order), "total": np.atleast_2d(sobol.total_order)}


def account_of(problem: DesignProblem, designs: int) -> tuple[dict[str, Any], list[str]]:
    """Parameters' shares by objective and kind of share; and lines for a person."""
    names = [parameter.name for parameter in problem.parameters]
    indices = shares(lambda z: problem(z).objectives, len(names), designs)
    results = {
        objective: {kind: dict(zip(names, values[index].tolist(), strict=True)) for kind, values in indices.items()}
        for index, objective in enumerate(problem.names)
    }
    return results, [line(objective, names, indices["total"][index]) for index, objective in enumerate(problem.names)]


def line(objective: str, names: list[str], total: np.ndarray) -> str:
    """Line for a person: the parameters (n,) that matter most, and how many hardly matter."""
    order = np.argsort(-total, kind="stable")
    most = ", ".join(f"{names[i]} {100 * max(total[i], 0):.0f} %" for i in order[:_SHOWN])
    little = int((total < 0.01).sum())
    return f"{objective} depends on {most}" + (
        f"; {little} of {len(names)} parameters matter below 1 %" if little else ""
    )
