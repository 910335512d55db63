"""Least squares of one form to curves. Moduli enter linearly and are eliminated; exponents and slack are searched from
several starts (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).

Exponents are positive where tension along one axis is all that was measured: a term of negative exponent resists
biaxial tension most, of which such a test says next to nothing (Ogden, Saccomandi and Sgura, Comput. Mech. 34,
2004)."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import nnls

from cfem.identify.material.curve import Curve
from cfem.identify.material.forms import Form, nominal_stress, shear_modulus
from cfem.identify.material.stability import is_stable_to, stable_to
from cfem.parametric.differences import Stencil, with_slopes
from cfem.parametric.least_squares import FitSettings, best_of, fit

_LOW, _HIGH = -12.0, 25.0  # exponents
_LEAST = 0.2  # exponent where tension along one axis is all that was measured
_STARTS = (-4.0, -2.0, 0.8, 2.0, 4.0, 8.0)
_SLACK = 0.15  # largest strain at which a specimen may still be slack
_STENCIL = Stencil(2, 1e-6)  # of exponents and slack


@dataclass(frozen=True)
class LawFit:
    """A law fitted to curves of m points.

    form:      of the law
    moduli:    (n,) MPa
    alpha:     (n_free,) exponents that were found
    slack:     strain at which the specimen is taut, 0 where none was asked for
    with_slack: whether it was fitted
    jacobian:  (m, n + n_free + with_slack) of the stress, by moduli, exponents and slack
    residuals: (m,) MPa, computed less measured
    held:      whether moduli were kept at their stable sign
    stable:    as `stability.stable_to` has it
    most:      stretch up to which stability was asked for"""

    form: Form
    moduli: np.ndarray
    alpha: np.ndarray
    slack: float
    with_slack: bool
    jacobian: np.ndarray
    residuals: np.ndarray
    held: bool
    stable: dict[str, float]
    most: float

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, MPa."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def shear(self) -> float:
        """Shear modulus at rest, MPa."""
        return float(shear_modulus(self.form, self.alpha) @ self.moduli)

    @property
    def young(self) -> float:
        """Young's modulus at rest of the incompressible law, MPa."""
        return 3 * self.shear

    @property
    def n_fitted(self) -> int:
        """Number of constants, the slack counted."""
        return self.form.constants + self.with_slack

    @property
    def is_stable(self) -> bool:
        """True where the law is stable in every mode, as far as was asked for."""
        return is_stable_to(self.stable, self.most)

    def predict(self, curve: Curve) -> np.ndarray:
        """Stresses (m,) MPa at the curve's stretches, slack counted."""
        return _design(self.form, self.alpha, self.slack, [curve]) @ self.moduli


def fit_law(form: Form, curves: Sequence[Curve], with_slack: bool = False, most: float | None = None) -> LawFit:
    """The law of a form that fits the curves best.

    with_slack: whether uniaxial specimens may be slack at first
    most:       stretch up to which stability is checked, and demanded where the form can give it; that of the curves
                unless given"""
    most = largest_stretch(curves) if most is None else most
    problem = _Projection(form, curves, with_slack, keep_signs=form.law == "ogden")
    alpha, slack, moduli = problem.solve()
    stable, held = stable_to(form, alpha, moduli, most), False
    if form.law != "ogden" and form.moduli > 1 and not is_stable_to(stable, most):
        problem, held = _Projection(form, curves, with_slack, keep_signs=True), True
        alpha, slack, moduli = problem.solve()
        stable = stable_to(form, alpha, moduli, most)
    jacobian = problem.jacobian(alpha, slack, moduli)
    residuals = _design(form, alpha, slack, curves) @ moduli - problem.target
    return LawFit(form, moduli, alpha, slack, with_slack, jacobian, residuals, held, stable, most)


def largest_stretch(curves: Sequence[Curve]) -> float:
    """The largest stretch of the curves, compression counted as its inverse."""
    return max(max(curve.stretch.max(), 1 / curve.stretch.min()) for curve in curves)


def _design(form: Form, alpha: Sequence[float], slack: float, curves: Sequence[Curve]) -> np.ndarray:
    """Nominal stresses (m, n) of each term at modulus 1; none while the specimen is slack."""
    parts = []
    for curve in curves:
        offset = slack if curve.mode == "uniaxial" else 0.0
        stretch = np.maximum(curve.stretch - offset, min(1.0, curve.stretch[0]))
        parts.append(nominal_stress(form, alpha, curve.mode, stretch))
    return np.concatenate(parts)


class _Projection:
    """The fit of a form with its moduli eliminated: unknowns z are the free exponents, then the slack.

    target: (m,) MPa measured"""

    def __init__(self, form: Form, curves: Sequence[Curve], with_slack: bool, keep_signs: bool):
        """Sets the curves to fit. keep_signs: moduli with signs that make every term stable: modulus times exponent
        positive, a Yeoh term's modulus positive."""
        self._form, self._curves, self._with_slack, self._keep_signs = form, curves, with_slack, keep_signs
        self.target = np.concatenate([curve.stress for curve in curves])

    def solve(self) -> tuple[np.ndarray, float, np.ndarray]:
        """Exponents, slack and moduli of the best fit from all starts."""
        free, slack = self._form.free, self._with_slack
        if not free and not slack:
            return self._parts(np.zeros(0))
        pulled = all(curve.mode == "uniaxial" and curve.stretch[0] > 0.9 for curve in self._curves)
        least = _LEAST if pulled else _LOW
        low = np.array([least] * free + [0.0] * slack)
        high = np.array([_HIGH] * free + [_SLACK] * slack)
        search = FitSettings(low, high, xtol=1e-12, ftol=1e-12, most=200)
        starts = [np.array([*start, *([0.3 * _SLACK] * slack)]) for start in _starts(free, least)]
        return self._parts(best_of([fit(self, start, search) for start in starts]).u)

    def __call__(self, z: np.ndarray, with_jacobian: bool) -> tuple[np.ndarray, np.ndarray | None]:
        if not with_jacobian:
            return self._residual(z), None
        return with_slopes(lambda batch: np.array([self._residual(point) for point in batch]), z, _STENCIL)

    def jacobian(self, alpha: np.ndarray, slack: float, moduli: np.ndarray) -> np.ndarray:
        """Derivative (m, k) of the stress by moduli, exponents and slack."""

        def stress(batch: np.ndarray) -> np.ndarray:
            return np.array([_design(self._form, *self._split(z), self._curves) @ moduli for z in batch])

        design = _design(self._form, alpha, slack, self._curves)
        z = np.array([*alpha, *([slack] * self._with_slack)])
        return np.hstack([design, with_slopes(stress, z, _STENCIL)[1]]) if len(z) else design

    def _split(self, z: np.ndarray) -> tuple[np.ndarray, float]:
        """Exponents and slack of the unknowns z."""
        free = self._form.free
        return z[:free], float(z[free]) if self._with_slack else 0.0

    def _residual(self, z: np.ndarray) -> np.ndarray:
        alpha, slack = self._split(z)
        design = _design(self._form, alpha, slack, self._curves)
        return (design @ self._moduli(alpha, design) - self.target) / np.abs(self.target).max()

    def _parts(self, z: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
        """Exponents, slack and the moduli that go with them, at the unknowns z."""
        alpha, slack = self._split(z)
        return alpha, slack, self._moduli(alpha, _design(self._form, alpha, slack, self._curves))

    def _moduli(self, alpha: np.ndarray, design: np.ndarray) -> np.ndarray:
        """Moduli (n,) MPa that fit best at given exponents."""
        size = np.abs(design).max(axis=0)
        size[size == 0] = 1.0  # a power of exponent zero bears nothing
        if not self._keep_signs:
            return np.linalg.lstsq(design / size, self.target, rcond=None)[0] / size
        signs = np.array([*np.sign(self._form.exponents(alpha)), *(1.0 for _ in self._form.degrees)])
        return signs * nnls(design * signs / size, self.target)[0] / size


def _starts(count: int, least: float) -> list[tuple[float, ...]]:
    """Exponents to start from."""
    starts = [exponent for exponent in _STARTS if exponent > least]
    return list(combinations(starts, count)) if count < 3 else [(-2.0, 2.0, 6.0), (0.8, 3.0, 8.0)][least > 0 :]
