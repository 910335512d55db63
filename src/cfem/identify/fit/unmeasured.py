"""Directions of the unknowns of which the measurements say nothing, and what of the unknowns is known all the same.

A change z + t v of the unknowns, t over all of their ranges, changes the residuals by c = J v / max |v_i|. Errors of
the model that may make up to d of each residual's change hide it where c^T c <= |c|^T d: fitted along v, these errors
alone may move the answer through the whole range. So a direction along which nothing changes in truth, such as all
moduli of a robot without loads where displacements are measured, is found although the slopes of a learned model along
it are not zero. Errors that wave have larger slopes than over the whole range: where a direction is weak, J is the mean
over the line along it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from cfem.condensed.parameters import Parameter, coordinates, range_coordinates
from cfem.core.errors import NumericalError
from cfem.identify.fit.uncertainty import RANK, Uncertainty

_NAMED = 1e-3  # smallest share of a direction that is mentioned
_PARTS = 2  # of a power: halves are tried in place of what the model's error has left of them
_LITTLE = 0.2  # share of its range: a parameter that goes with a direction by less is known all the same
_WEAK = 30.0  # times what errors hide: a direction that changes less is looked at over its whole line
_SLIGHT = 5.0  # times what errors hide: a direction of plain powers may change as much, as errors that wave do
_SHORTEST = 0.25  # line through the ranges, in units of their width
_LINE = np.polynomial.legendre.leggauss(8)  # points in [-1, 1] and weights of a mean over a line

# Jacobian (n_r, n) of the residuals by shares of the ranges, and by how much (n_r,) errors may change each residual
# where an unknown goes through its range, None where nothing but rounding is known
Slopes = tuple[np.ndarray, np.ndarray | None]


@dataclass(frozen=True)
class Combination:
    """A product of powers of unknowns, such as 'E2/E1', that is known though they are not.

    interval: its ends, within what the ranges allow; None where the noise is not known"""

    name: str
    value: float
    interval: tuple[float, float] | None


@dataclass(frozen=True)
class Unmeasured:
    """Directions of the shares of the parameters' ranges that move nothing measured by more than errors do.

    directions: (k, n), the leader's entry is 1
    leaders:    (k,) numbers of the parameters that lead them and take part in no other
    slight:     (k, n) what goes with them beside, by less than _LITTLE of its range"""

    directions: np.ndarray
    leaders: np.ndarray
    slight: np.ndarray

    def __len__(self) -> int:
        return len(self.directions)

    def carried(self, slopes: np.ndarray) -> np.ndarray:
        """Largest changes (...,) of linear functions of the shares, slopes (..., n), by what goes slightly with the
        directions, over all of the ranges."""
        return np.abs(slopes @ self.slight.T).sum(axis=-1)


def hidden(changes: np.ndarray, false_change: np.ndarray, times: float = 1.0) -> np.ndarray:
    """Mask (k,) of the changes (n_r, k) of residuals that errors of up to `times` false_change (n_r,) may have made."""
    size = np.abs(changes)
    return (size * (size - times * false_change[:, None])).sum(axis=0) <= 0


def unmeasured(
    slopes: Slopes, elsewhere: Callable[[np.ndarray], Slopes], z: np.ndarray, parameters: Sequence[Parameter]
) -> Unmeasured:
    """Directions of the shares z (n,) of the parameters' ranges that move nothing measured by more than errors do.

    slopes:    at z
    elsewhere: gives those at another z"""
    jacobian, error = _with_rounding(*slopes)
    directions, changes = _singular(jacobian)
    weak, blind = hidden(changes, error, _WEAK), hidden(changes, error)
    if weak.any() and not blind[weak].all():
        jacobian, error = _over_lines(elsewhere, z, directions[weak]) or (jacobian, error)
        directions, changes = _singular(jacobian)
        blind = hidden(changes, error)
    if not blind.any():
        return Unmeasured(directions[:0], np.zeros(0, dtype=int), directions[:0])
    return _led(directions[blind], parameters, jacobian, error)


def _singular(jacobian: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Right singular directions (n, n), the strongest first, and the changes (n_r, n) of residuals along them."""
    directions = np.linalg.svd(np.linalg.qr(jacobian, mode="r"))[2]
    return directions, _over_ranges(jacobian, directions)


def _with_rounding(jacobian: np.ndarray, error: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """The slopes, with errors that have the rounding of the Jacobian."""
    rounding = RANK * np.sqrt(jacobian.shape[1]) * np.linalg.norm(jacobian)
    return jacobian, np.full(len(jacobian), rounding) + (0.0 if error is None else error)


def _over_lines(
    elsewhere: Callable[[np.ndarray], Slopes], z: np.ndarray, directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Means of the slopes over lines through z along directions (k, n), from end to end of the ranges; None where they
    are not known all along. Errors make more of the mean slope over a shorter line."""
    means = []
    for direction in directions:
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.sort(np.array([-z, 1 - z]) / direction, axis=0)
        low, high = np.nanmax(ends[0]), np.nanmin(ends[1])
        try:
            along = [_with_rounding(*elsewhere(z + t * direction)) for t in (low + high + (high - low) * _LINE[0]) / 2]
        except NumericalError:
            return None
        jacobian, error = (np.tensordot(_LINE[1] / 2, np.array(values), 1) for values in zip(*along, strict=True))
        means.append((jacobian, error / np.clip((high - low) * np.abs(direction).max(), _SHORTEST, 1)))
    return tuple(np.mean(values, axis=0) for values in zip(*means, strict=True))


def _led(
    directions: np.ndarray, parameters: Sequence[Parameter], jacobian: np.ndarray, error: np.ndarray
) -> Unmeasured:
    """Directions (k, n) in another basis, each led by one parameter, with powers of halves and wholes where these
    change hardly more."""
    leaders = qr(directions, pivoting=True, mode="r")[1][: len(directions)]
    led = np.linalg.solve(directions[:, leaders], directions)
    slight = np.where(np.abs(led) < _LITTLE, led, 0.0)
    scale = _spans(parameters) / _spans(parameters)[leaders, None]  # from shares to powers, that of the leader 1
    rounded = np.round(_PARTS * (led - slight) * scale) / (_PARTS * scale)
    changes = _over_ranges(jacobian, rounded + slight)
    plain = _of_logarithms(led - slight, parameters) & hidden(changes, error, _SLIGHT)
    return Unmeasured(np.where(plain[:, None], rounded, led - slight), leaders, slight)


def known_combinations(
    blind: Unmeasured, parameters: Sequence[Parameter], p: np.ndarray, known: Uncertainty
) -> list[Combination]:
    """Combinations that no unmeasured direction changes, at the values p (n,) of the parameters: one for each that goes
    with such directions and leads none, where all that takes part has logarithms for coordinates."""
    spans, combinations = _spans(parameters), []
    for i in range(len(parameters)):
        with_it = blind.directions[:, i] != 0
        if i in blind.leaders or not with_it.any() or not _of_logarithms(blind.directions[with_it], parameters).all():
            continue
        share = np.zeros(len(parameters))  # slope by the shares
        share[i] = spans[i]
        share[blind.leaders] -= blind.directions[:, i] * spans[i]
        powers, half = share / spans, float(known.half(share) + blind.carried(share))
        value = float(powers @ coordinates(parameters, p))
        ends = np.sort(powers * range_coordinates(parameters), axis=0).sum(axis=1)  # of the ranges
        interval = np.exp(np.clip([value - half, value + half], *ends)) if np.isfinite(half) else None
        pair = None if interval is None else (float(interval[0]), float(interval[1]))
        combinations.append(Combination(_product(powers, parameters), float(np.exp(value)), pair))
    return combinations


def unmeasured_sentences(blind: Unmeasured, parameters: Sequence[Parameter], advice: str) -> list[str]:
    """Sentences on the directions; advice: what to measure where moduli only act together."""
    rows = zip(blind.directions, blind.leaders, blind.slight, strict=True)
    return [_sentence(*row, parameters, advice) for row in rows]


def _sentence(
    direction: np.ndarray, leader: int, slight: np.ndarray, parameters: Sequence[Parameter], advice: str
) -> str:
    """Sentence on one direction (n,); slight (n,): what goes with it beside."""
    weights = direction / np.abs(direction).max()
    part = np.flatnonzero(np.abs(weights) > _NAMED)
    named = [parameters[i] for i in part]
    if len(named) == 1:
        others = [parameters[i].name for i in np.flatnonzero(np.abs(slight) > _NAMED)]
        why = "it changes what was measured by no more than the model's own error"
        return f"{named[0].name} cannot be found: {f'small changes of {_listed(others)} hide it' if others else why}"
    if not _of_logarithms(direction[None], parameters)[0]:
        along = " ".join(f"{weights[i]:+.2g} {parameters[i].name}" for i in part).removeprefix("+")
        return f"only together: a change along {along} (shares of their ranges) moves nothing measured"
    powers = (direction * _spans(parameters) / _spans(parameters)[leader])[part]
    factors = [f"{_power('c', power)} {parameter.name}" for power, parameter in zip(powers, named, strict=True)]
    moduli = all(parameter.is_stiffness for parameter in named)
    return (
        f"{_listed([parameter.name for parameter in named])} cannot be found: {_listed(factors)} give the same "
        f"measurements for every c, to the model's own error{f'; {advice}' if moduli and advice else ''}"
    )


def _listed(texts: Sequence[str]) -> str:
    """'a, b and c'."""
    *first, last = texts
    return f"{', '.join(first)} and {last}" if first else last


def _spans(parameters: Sequence[Parameter]) -> np.ndarray:
    """Widths (n,) of the ranges in the parameters' coordinates."""
    low, high = range_coordinates(parameters)
    return high - low


def _over_ranges(jacobian: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Changes (n_r, k) of residuals along directions (k, n) of shares, from one end of the ranges to the other."""
    return jacobian @ (directions / np.abs(directions).max(axis=1, keepdims=True)).T


def _of_logarithms(directions: np.ndarray, parameters: Sequence[Parameter]) -> np.ndarray:
    """Mask (k,) of the directions (k, n) in which only parameters take part whose coordinate is a logarithm."""
    others = [i for i, parameter in enumerate(parameters) if parameter.coordinate != "log"]
    largest = np.abs(directions).max(axis=1, initial=0.0)
    return (np.abs(directions[:, others]) <= _NAMED * largest[:, None]).all(axis=1)


def _product(powers: np.ndarray, parameters: Sequence[Parameter]) -> str:
    """Product of powers of parameters as text: 'E2/(E1 E3^0.5)'."""
    above = [_power(p.name, power) for p, power in zip(parameters, powers, strict=True) if power > _NAMED]
    below = [_power(p.name, -power) for p, power in zip(parameters, powers, strict=True) if power < -_NAMED]
    product, divisor = " ".join(above), " ".join(below)
    if not below:
        return product
    return f"{product}/{divisor}" if len(below) == 1 else f"{product}/({divisor})"


def _power(name: str, power: float) -> str:
    return name if abs(power - 1) < _NAMED else f"{name}^{power:.3g}"
