"""Least squares of one form to curves. Moduli enter linearly and are eliminated; exponents and slack are searched from
several starts (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).

Exponents are positive where tension along one axis is all that was measured: a term of negative exponent resists
biaxial tension most, of which such a test says next to nothing (Ogden, Saccomandi and Sgura, Comput. Mech. 34,
2004)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from cfem.tensile.curve import Curve
from cfem.tensile.forms import Form, nominal_stress, shear_modulus
from cfem.tensile.stability import stable_to

_LOW, _HIGH = -12.0, 25.0  # exponents
_LEAST = 0.2  # exponent where tension along one axis is all that was measured
_STARTS = (-4.0, -2.0, 0.8, 2.0, 4.0, 8.0)
_SLACK = 0.15  # largest strain at which a specimen may still be slack


@dataclass(frozen=True)
class Fit:
    """moduli (n,) MPa and alpha (n_free,) as `forms` has them; slack: strain at which the specimen is taut,
    0 where none was asked for; covariance: of (moduli, alpha, slack if fitted), nan where the curves do not determine
    it; residuals (m,) MPa, computed less measured; held: moduli were kept at their stable sign; stable: as
    `stability.stable_to` has it."""

    form: Form
    moduli: np.ndarray
    alpha: np.ndarray
    slack: float
    with_slack: bool
    covariance: np.ndarray
    residuals: np.ndarray
    held: bool
    stable: dict[str, float]

    @property
    def rms(self) -> float:
        """MPa."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def shear(self) -> float:
        """MPa, at rest."""
        return float(shear_modulus(self.form, self.alpha) @ self.moduli)

    @property
    def young(self) -> float:
        """MPa, at rest, of the incompressible law."""
        return 3 * self.shear

    @property
    def n_fitted(self) -> int:
        return self.form.constants + self.with_slack

    def predict(self, curve: Curve) -> np.ndarray:
        """(m,) MPa at the curve's stretches, slack counted."""
        return _design(self.form, self.alpha, self.slack, [curve]) @ self.moduli


def fit(form: Form, curves: Sequence[Curve], with_slack: bool = False, most: float | None = None) -> Fit:
    """most: stretch up to which stability is checked, and demanded where the form can give it; that of the curves
    unless given."""
    most = max(max(one.stretch.max(), 1 / one.stretch.min()) for one in curves) if most is None else most
    target = np.concatenate([one.stress for one in curves])
    found = _search(form, curves, target, with_slack, keep=form.law == "ogden")
    held = False
    limits = _limits(form, found, most)
    if form.law != "ogden" and form.moduli > 1 and not _all_stable(limits, most):
        found, held = _search(form, curves, target, with_slack, keep=True), True
        limits = _limits(form, found, most)
    alpha, slack, moduli = found
    residuals = _design(form, alpha, slack, curves) @ moduli - target
    covariance = _covariance(form, found, curves, with_slack, residuals)
    return Fit(form, moduli, alpha, slack, with_slack, covariance, residuals, held, limits)


Found = tuple[np.ndarray, float, np.ndarray]  # alpha, slack, moduli


def _limits(form: Form, found: Found, most: float) -> dict[str, float]:
    alpha, _, moduli = found
    return stable_to(form, alpha, moduli, most)


def _all_stable(limits: dict[str, float], most: float) -> bool:
    return all(np.isclose(one, 1 / most if name == "compression" else most) for name, one in limits.items())


def _design(form: Form, alpha: Sequence[float], slack: float, curves: Sequence[Curve]) -> np.ndarray:
    """(m, n) nominal stress of each term at modulus 1; none while the specimen is slack."""
    parts = []
    for one in curves:
        offset = slack if one.mode == "uniaxial" else 0.0
        parts.append(nominal_stress(form, alpha, one.mode, np.maximum(one.stretch - offset, min(1.0, one.stretch[0]))))
    return np.concatenate(parts)


def _moduli(form: Form, alpha: np.ndarray, design: np.ndarray, target: np.ndarray, keep: bool) -> np.ndarray:
    """keep: signs that make every term stable: modulus times exponent positive, a Yeoh term's modulus positive."""
    from scipy.optimize import nnls

    size = np.abs(design).max(axis=0)
    size[size == 0] = 1.0  # a power of exponent zero bears nothing
    if not keep:
        return np.linalg.lstsq(design / size, target, rcond=None)[0] / size
    signs = np.array([*np.sign(form.exponents(alpha)), *(1.0 for _ in form.degrees)])
    return signs * nnls(design * signs / size, target)[0] / size


def _search(form: Form, curves: Sequence[Curve], target: np.ndarray, with_slack: bool, keep: bool) -> Found:
    from scipy.optimize import least_squares

    def parts(z: np.ndarray) -> Found:
        alpha, slack = z[: form.free], float(z[form.free]) if with_slack else 0.0
        design = _design(form, alpha, slack, curves)
        return alpha, slack, _moduli(form, alpha, design, target, keep)

    def residual(z: np.ndarray) -> np.ndarray:
        alpha, slack, moduli = parts(z)
        return (_design(form, alpha, slack, curves) @ moduli - target) / np.abs(target).max()

    if not form.free and not with_slack:
        return parts(np.zeros(0))
    least = _LEAST if all(one.mode == "uniaxial" and one.stretch[0] > 0.9 for one in curves) else _LOW
    low = np.array([least] * form.free + [0.0] * with_slack)
    high = np.array([_HIGH] * form.free + [_SLACK] * with_slack)
    best = None
    for start in _starts(form.free, least):
        z0 = np.array([*start, *([0.3 * _SLACK] * with_slack)])
        found = least_squares(residual, z0, bounds=(low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12, max_nfev=200)
        if best is None or found.cost < best.cost:
            best = found
    return parts(best.x)


def _starts(count: int, least: float) -> list[tuple[float, ...]]:
    starts = [one for one in _STARTS if one > least]
    return list(combinations(starts, count)) if count < 3 else [(-2.0, 2.0, 6.0), (0.8, 3.0, 8.0)][least > 0 :]


def _covariance(
    form: Form, found: Found, curves: Sequence[Curve], with_slack: bool, residuals: np.ndarray
) -> np.ndarray:
    """(k, k) of (moduli, alpha, slack): s^2 (J^T J)^-1, s^2 raised by what neighbouring points share: points of one
    curve are not independent, and m of them with correlation r count as m (1 - r) / (1 + r)."""
    alpha, slack, moduli = found
    z = np.concatenate([moduli, alpha, [slack] * with_slack])

    def stress(z: np.ndarray) -> np.ndarray:
        n, k = form.moduli, form.constants
        return _design(form, z[n:k], z[k] if with_slack else 0.0, curves) @ z[:n]

    J = np.stack([_slope(stress, z, i) for i in range(len(z))], axis=1)
    free = len(residuals) - len(z)
    if free < 1:
        return np.full((len(z), len(z)), np.nan)
    shared = float(np.clip((residuals[1:] @ residuals[:-1]) / max(residuals @ residuals, 1e-300), 0.0, 0.95))
    variance = residuals @ residuals / free * (1 + shared) / (1 - shared)
    size = np.linalg.norm(J, axis=0)
    used = size > 0
    covariance = np.full((len(z), len(z)), np.nan)
    scaled = J[:, used] / size[used]
    if np.linalg.cond(scaled) < 1e8:
        inverse = np.linalg.inv(scaled.T @ scaled) / np.outer(size[used], size[used])
        covariance[np.ix_(used, used)] = variance * inverse
    return covariance


def _slope(function, z: np.ndarray, i: int) -> np.ndarray:
    step = np.zeros_like(z)
    step[i] = 1e-6 * max(abs(z[i]), 1e-3 * np.abs(z).max(), 1e-9)
    return (function(z + step) - function(z - step)) / (2 * step[i])
