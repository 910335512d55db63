"""Sentences on what the measurements cannot tell: unknowns that nothing measured depends on, that only act together,
that are hardly known, that cannot be told apart, that lie at an end of their range."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import qr

from cfem.condensed.parameters import Parameter
from cfem.identify.fit.free_parameter import FreeParameter, is_at_end
from cfem.identify.fit.uncertainty import RANK, Information, Uncertainty, correlation

_WEAK = 0.5  # of its range: an interval wider than this says little about a parameter
_NAMED = 1e-3  # smallest share of a direction that is mentioned
_ALIKE = 0.9  # correlation beyond which two unknowns cannot be told apart
_LEARNED = 0.7  # of the prior standard deviation: above it the measurements say little
_END = 1e-3  # of its range, within which an unknown lies at an end of it


def unseen(jacobians: Sequence[np.ndarray], change: float) -> np.ndarray:
    """Mask (n,) of the unknowns that move nothing that was measured, at any of the places where the Jacobians (n_r, n)
    are from; change: size of the largest measured change, in the residuals' units."""
    largest = np.max([np.abs(jacobian).max(axis=0) for jacobian in jacobians], axis=0)
    return largest <= RANK * max(change, float(largest.max(initial=0.0)))


def unseen_sentence(parameter: Parameter, kind: str, measured: Sequence[str]) -> str:
    """The sentence on a parameter that nothing measured depends on.

    kind:     'displacement' or 'force', by which the actuators were driven
    measured: 'effectors', 'actuators' or both"""
    if parameter.exact and kind == "displacement" and "actuators" not in measured:
        return (
            f"{parameter.name} cannot be found from displacements alone: a robot of one material without loads takes "
            "the same shape whatever its modulus (W ~ 1/E, lambda ~ E); measure a force"
        )
    return f"{parameter.name} cannot be found: nothing that was measured depends on it"


def share_sentences(parameters: Sequence[Parameter], known: Uncertainty) -> list[str]:
    """Sentences on parameters found as shares of their ranges: which only act together, which are weakly identifiable,
    and else that all are identifiable."""
    sentences = _combinations(known.information, parameters)
    for parameter, half in zip(parameters, known.half(np.eye(len(parameters))), strict=True):
        if np.isfinite(half) and half > _WEAK:
            sentences.append(
                f"{parameter.name} is weakly identifiable: known to +-{100 * half:.0f} % of its range "
                f"[{parameter.low:g}, {parameter.high:g}]{parameter.suffix}"
            )
    if not sentences and len(parameters):
        values = known.information.singular_values
        condition = f", condition {values[0] / values[-1]:.1e}" if len(parameters) > 1 else ""
        sentences.append(f"{', '.join(parameter.name for parameter in parameters)}: identifiable{condition}")
    return sentences


def prior_sentences(
    unknowns: Sequence[FreeParameter], prior: Sequence[bool], z: np.ndarray, covariance: np.ndarray
) -> list[str]:
    """Sentences on unknowns of which something may be known before: which the measurements say little of, which cannot
    be told apart, which lie at an end of their range.

    prior: whether each has a normal prior of standard deviation one in z; z (n,), covariance (n, n): at the answer"""
    deviations, correlations = np.sqrt(np.diag(covariance)), correlation(covariance)
    sentences = []
    for i, unknown in enumerate(unknowns):
        if prior[i] and deviations[i] > _LEARNED:
            sentences.append(
                f"{unknown.name}: the measurements say little of it, its interval is {100 * deviations[i]:.0f} % as "
                "wide as what was known before"
            )
        for j in range(i):
            if abs(correlations[i, j]) > _ALIKE:
                sense = "together" if correlations[i, j] > 0 else "against each other"
                sentences.append(
                    f"{unknowns[j].name} and {unknown.name} cannot be told apart: changed {sense} they leave nearly "
                    f"the same shapes (correlation {correlations[i, j]:+.2f})"
                )
        if is_at_end(unknown, z[i], _END):
            sentences.append(f"{unknown.name} lies at an end of its range: widen it, or ask why")
    return sentences


def _combinations(known: Information, parameters: Sequence[Parameter]) -> list[str]:
    """Sentences on the directions that move nothing measured. Another basis of the same directions is as good: here
    each parameter that leads one takes part in no other."""
    unmeasured, sentences = known.unmeasured, []
    if not len(unmeasured):
        return []
    leaders = qr(unmeasured, pivoting=True, mode="r")[1][: len(unmeasured)]
    for direction in np.linalg.solve(unmeasured[:, leaders], unmeasured):
        direction = direction / np.abs(direction).max()
        parts = [
            f"{weight:+.2g} {parameter.name}"
            for weight, parameter in zip(direction, parameters, strict=True)
            if abs(weight) > _NAMED
        ]
        together = " ".join(parts).removeprefix("+")
        sentences.append(f"only together: a change along {together} (shares of their ranges) moves nothing measured")
    return sentences
