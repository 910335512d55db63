"""A fit as a scene writes it, and how well its numbers are known."""

from typing import Any

import numpy as np

from cfem.tensile.fit import Fit
from cfem.tensile.forms import shear_modulus

_DIGITS = 4


def scene_material(fit: Fit, poisson: float) -> dict[str, Any]:
    """What stands under `material:` in a scene."""
    return {**_constants(fit), "poisson": poisson}


def as_yaml(material: dict[str, Any]) -> str:
    """In one line: {law: ogden, mu: {kPa: [17.1]}, alpha: [2.41], poisson: 0.499}."""

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key}: {text(one)}" for key, one in value.items()) + "}"
        return "[" + ", ".join(map(text, value)) + "]" if isinstance(value, list) else f"{value}"

    return text(material)


def _constants(fit: Fit) -> dict[str, Any]:
    moduli = fit.moduli
    if fit.form.law == "ogden":
        used = np.abs(moduli) > 1e-9 * np.abs(moduli).max()
        unit, factor = _unit(np.abs(moduli).max())
        mu = [_rounded(factor * one) for one in moduli[used]]
        return {"law": "ogden", "mu": {unit: mu}, "alpha": [_rounded(one) for one in fit.alpha[used]]}
    if fit.form.law == "mooney-rivlin":
        c10, c01 = moduli[0] / 2, -moduli[1] / 2  # w = c10 (I1 - 3) + c01 (I2 - 3)
        return {"law": "mooney-rivlin", "c10": _quantity(c10), "c01": _quantity(c01)}
    named = {f"c{degree}": _quantity(one) for degree, one in zip(fit.form.degrees, moduli, strict=True) if one != 0}
    return {"law": "yeoh", **named}


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _unit(size: float) -> tuple[str, float]:
    return ("MPa", 1.0) if size >= 1 else ("kPa", 1e3)


def _quantity(value: float) -> str:
    unit, factor = _unit(abs(value))
    return f"{_rounded(factor * value):g} {unit}"


def intervals(fit: Fit) -> dict[str, tuple[float, float]]:
    """{name: (value, half of the 95 % interval)} of moduli (MPa), exponents, slack and Young's modulus at rest (MPa);
    nan where the curves do not determine it."""
    from scipy.stats import t

    degrees = max(len(fit.residuals) - fit.n_fitted, 1)
    factor = float(t.ppf(0.975, degrees))
    names = [f"modulus {i + 1}" for i in range(fit.form.moduli)] + [f"exponent {i + 1}" for i in range(fit.form.free)]
    values = [*fit.moduli, *fit.alpha]
    if fit.with_slack:
        names, values = [*names, "slack"], [*values, fit.slack]
    half = factor * np.sqrt(np.diag(fit.covariance))
    found = {name: (float(value), float(one)) for name, value, one in zip(names, values, half, strict=True)}
    slope = np.concatenate([shear_modulus(fit.form, fit.alpha), _by_exponent(fit), [0.0] * fit.with_slack])
    used = np.isfinite(np.diag(fit.covariance))
    variance = slope[used] @ fit.covariance[np.ix_(used, used)] @ slope[used] if used.any() else np.nan
    return found | {"young": (fit.young, 3 * factor * float(np.sqrt(variance)))}


def _by_exponent(fit: Fit) -> np.ndarray:
    """(n_free,) d shear / d alpha = modulus / 2 of the terms whose exponents were found."""
    free = [power is None for power in fit.form.powers]
    return fit.moduli[: len(free)][free] / 2
