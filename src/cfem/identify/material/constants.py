"""A fit as a scene writes it, and how well its numbers are known."""

from typing import Any

import numpy as np

from cfem.identify.fit.uncertainty import uncertainty
from cfem.identify.material.fit import LawFit
from cfem.identify.material.forms import shear_modulus

_DIGITS = 4
_SHARED = 0.95  # largest correlation of neighbouring residuals that is allowed for


def scene_material(fit: LawFit, poisson: float) -> dict[str, Any]:
    """The entry `material:` of a scene."""
    return {**_constants(fit), "poisson": poisson}


def as_yaml(material: dict[str, Any]) -> str:
    """The material in one line: {law: ogden, mu: {kPa: [17.1]}, alpha: [2.41], poisson: 0.499}."""

    def text(value: Any) -> str:
        if isinstance(value, dict):
            return "{" + ", ".join(f"{key}: {text(item)}" for key, item in value.items()) + "}"
        return "[" + ", ".join(map(text, value)) + "]" if isinstance(value, list) else f"{value}"

    return text(material)


def intervals(fit: LawFit) -> dict[str, tuple[float, float]]:
    """Value and half of the 95 % interval by name, of moduli (MPa), exponents, slack and Young's modulus at rest (MPa);
    half inf or nan where the curves do not determine it. Points of one curve are not independent: the correlation of
    neighbouring residuals widens the intervals."""
    names = [f"modulus {i + 1}" for i in range(fit.form.moduli)] + [f"exponent {i + 1}" for i in range(fit.form.free)]
    names += ["slack"] * fit.with_slack
    values = [*fit.moduli, *fit.alpha, *([fit.slack] * fit.with_slack)]
    r = fit.residuals
    shared = float(np.clip((r[1:] @ r[:-1]) / max(r @ r, 1e-300), 0.0, _SHARED))
    size = np.linalg.norm(fit.jacobian, axis=0)
    size[size == 0] = 1.0  # a constant that moves no stress is not determined
    known = uncertainty(r, fit.jacobian / size, known=False, confidence=0.95, shared=shared)
    halves = known.half(np.eye(len(values)) / size)
    slope = np.concatenate([shear_modulus(fit.form, fit.alpha), _shear_by_exponent(fit), [0.0] * fit.with_slack])
    known_constants = dict(zip(names, zip(map(float, values), map(float, halves), strict=True), strict=True))
    return known_constants | {"young": (fit.young, 3 * float(known.half(slope / size)))}


def _constants(fit: LawFit) -> dict[str, Any]:
    """Law and constants with their units, as a scene names them."""
    moduli = fit.moduli
    if fit.form.law == "ogden":
        used = np.abs(moduli) > 1e-9 * np.abs(moduli).max()
        unit, factor = _unit(np.abs(moduli).max())
        mu = [_rounded(factor * modulus) for modulus in moduli[used]]
        return {"law": "ogden", "mu": {unit: mu}, "alpha": [_rounded(exponent) for exponent in fit.alpha[used]]}
    if fit.form.law == "mooney-rivlin":
        c10, c01 = moduli[0] / 2, -moduli[1] / 2  # w = c10 (I1 - 3) + c01 (I2 - 3)
        return {"law": "mooney-rivlin", "c10": _quantity(c10), "c01": _quantity(c01)}
    terms = zip(fit.form.degrees, moduli, strict=True)
    return {"law": "yeoh", **{f"c{degree}": _quantity(modulus) for degree, modulus in terms if modulus != 0}}


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")


def _unit(size: float) -> tuple[str, float]:
    return ("MPa", 1.0) if size >= 1 else ("kPa", 1e3)


def _quantity(value: float) -> str:
    unit, factor = _unit(abs(value))
    return f"{_rounded(factor * value):g} {unit}"


def _shear_by_exponent(fit: LawFit) -> np.ndarray:
    """Derivatives (n_free,) d shear / d alpha = modulus / 2 of the terms whose exponents were found."""
    free = [power is None for power in fit.form.powers]
    return fit.moduli[: len(free)][free] / 2
