"""What the measurements can tell, in words: from the singular values of the Jacobian dr/dz, whose columns are changes
over the whole range of a parameter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from cfem.calibrate.confidence import RANK, Spread
from cfem.condensed.parameters import Parameter

WEAK = 0.5  # of its range: an interval wider than this says little about a parameter
_NAMED = 1e-3  # smallest share of a direction that is mentioned


@dataclass(frozen=True)
class Identifiability:
    """singular_values: (n,) of dr/dz, largest first; rank; sentences: for the user."""

    singular_values: np.ndarray
    rank: int
    sentences: list[str]


def unseen(jacobians: Sequence[np.ndarray], change: float) -> np.ndarray:
    """(n,) which parameters move nothing that was measured, at any of the places where the Jacobians (n_r, n) are from;
    change: size of the largest measured change, in the residuals' units."""
    largest = np.max([np.abs(one).max(axis=0) for one in jacobians], axis=0)
    return largest <= RANK * max(change, float(largest.max(initial=0.0)))


def why_unseen(parameter: Parameter, kind: str, measured: Sequence[str]) -> str:
    """measured: 'effectors', 'actuators' or both."""
    sentence = f"{parameter.name} cannot be found: nothing that was measured depends on it"
    if parameter.exact and kind == "displacement" and "actuators" not in measured:
        sentence = (
            f"{parameter.name} cannot be found from displacements alone: a robot of one material without loads takes "
            "the same shape whatever its modulus (W ~ 1/E, lambda ~ E); measure a force"
        )
    return sentence


def identifiability(jacobian: np.ndarray, parameters: Sequence[Parameter], spread: Spread) -> Identifiability:
    """jacobian: (n_r, n) at the solution, of the parameters that something measured sees."""
    _, S, Vt = np.linalg.svd(jacobian)
    values = np.zeros(len(parameters))
    values[: len(S)] = S
    rank = int((values > RANK * values.max(initial=0.0)).sum()) if values.max(initial=0.0) > 0 else 0
    sentences = _combinations(Vt[rank:], parameters)
    for one, deviation in zip(parameters, spread.deviations, strict=True):
        if not np.isfinite(deviation):
            continue
        half = spread.quantile * deviation
        if half > WEAK:
            unit = "" if one.unit == "1" else f" {one.unit}"
            sentences.append(
                f"{one.name} is weakly identifiable: known to +-{100 * half:.0f} % of its range "
                f"[{one.low:g}, {one.high:g}]{unit}"
            )
    if not sentences and len(parameters):
        most = f", condition {values[0] / values[-1]:.1e}" if len(parameters) > 1 else ""
        sentences.append(f"{', '.join(one.name for one in parameters)}: identifiable{most}")
    return Identifiability(values, rank, sentences)


def _combinations(blind: np.ndarray, parameters: Sequence[Parameter]) -> list[str]:
    """blind: (k, n). Another basis of the same directions is as good: here each parameter that leads one takes part in
    no other."""
    if not len(blind):
        return []
    leaders = qr(blind, pivoting=True, mode="r")[1][: len(blind)]
    sentences = []
    for direction in np.linalg.solve(blind[:, leaders], blind):
        direction = direction / np.abs(direction).max()
        parts = [
            f"{weight:+.2g} {one.name}"
            for weight, one in zip(direction, parameters, strict=True)
            if abs(weight) > _NAMED
        ]
        together = " ".join(parts).removeprefix("+")
        sentences.append(f"only together: a change along {together} (shares of their ranges) moves nothing measured")
    return sentences
