"""Sentences on what the measurements cannot tell: unknowns that nothing measured depends on, that are hardly known,
that cannot be told apart, that lie at an end of their range."""

from collections.abc import Sequence

import numpy as np

from cfem.condensed.parameters import Parameter
from cfem.identify.fit.free_parameter import FreeParameter, is_at_end
from cfem.identify.fit.uncertainty import RANK, Uncertainty, correlation
from cfem.identify.fit.unmeasured import hidden

_WEAK = 0.5  # of its range: an interval wider than this says little about a parameter
_ALIKE = 0.9  # correlation beyond which two unknowns cannot be told apart
_LEARNED = 0.7  # of the prior standard deviation: above it the measurements say little
_END = 1e-3  # of its range, within which an unknown lies at an end of it


def unseen(jacobians: Sequence[np.ndarray], change: float, errors: Sequence[np.ndarray | None]) -> np.ndarray:
    """Mask (n,) of the unknowns that move nothing that was measured by more than errors do, at any of the places where
    the Jacobians (n_r, n) are from.

    change: size of the largest measured change, in the residuals' units
    errors: (n_r,) at each place, by how much errors alone may change each residual where an unknown goes through its
    range; None where they are not known"""
    largest = np.max([np.abs(jacobian).max(axis=0) for jacobian in jacobians], axis=0)
    rounding = RANK * max(change, float(largest.max(initial=0.0)))
    return np.all(
        [
            hidden(jacobian, np.full(len(jacobian), rounding) + (0.0 if error is None else error))
            for jacobian, error in zip(jacobians, errors, strict=True)
        ],
        axis=0,
    )


def unseen_sentence(parameter: Parameter, kind: str, measured: Sequence[str]) -> str:
    """The sentence on a parameter that nothing measured depends on.

    kind:     'displacement' or 'force', by which the actuators were driven
    measured: 'effectors', 'actuators' or both"""
    if parameter.exact and kind == "displacement" and "actuators" not in measured:
        return (
            f"{parameter.name} cannot be found from displacements alone: a robot of one material without loads takes "
            "the same shape whatever its modulus (W ~ 1/E, lambda ~ E); measure a force"
        )
    return f"{parameter.name} cannot be found: it changes what was measured by no more than the model's own error"


def advice(kind: str, measured: Sequence[str]) -> str:
    """Advice on what to measure where moduli only act together; arguments as of `unseen_sentence`."""
    if kind == "displacement" and "actuators" not in measured:
        return "displacements alone do not tell the moduli of a robot without loads: measure a force"
    return ""


def share_sentences(parameters: Sequence[Parameter], known: Uncertainty, carried: np.ndarray) -> list[str]:
    """Sentences on parameters found as shares of their ranges: which are weakly identifiable, and else that all are
    identifiable; none where some are not. carried: (n,) shares by which they change with others that are not known."""
    sentences = []
    for parameter, half in zip(parameters, known.half(np.eye(len(parameters))) + carried, strict=True):
        if np.isfinite(half) and half > _WEAK:
            known_to = f"+-{100 * half:.0f} % of" if half < 1 else "no better than"
            sentences.append(
                f"{parameter.name} is weakly identifiable: known to {known_to} its range "
                f"[{parameter.low:g}, {parameter.high:g}]{parameter.suffix}"
            )
    if not sentences and len(parameters) == known.information.rank > 0:
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
