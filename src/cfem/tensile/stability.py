"""Drucker's condition for an incompressible law: work of every small increment of stress is positive, d t : d h > 0."""

from collections.abc import Sequence

import numpy as np

from cfem.tensile.forms import MODES, Form, curvature, log_stretches

_POINTS = 241


def stable_to(form: Form, alpha: Sequence[float], moduli: np.ndarray, most: float) -> dict[str, float]:
    """Stretch up to which the law is stable in tension of every mode and in uniaxial compression, at most `most`; of
    compression, down to which, at least 1 / most."""
    rise = np.exp(np.linspace(0.0, np.log(most), _POINTS))
    tests = {mode: (mode, rise) for mode in MODES} | {"compression": ("uniaxial", 1 / rise)}
    return {name: _first(form, alpha, moduli, mode, stretch) for name, (mode, stretch) in tests.items()}


def _first(form: Form, alpha: Sequence[float], moduli: np.ndarray, mode, stretch: np.ndarray) -> float:
    least = least_stiffness(form, alpha, moduli, log_stretches(mode, stretch))
    lost = np.flatnonzero(~(least > 0))
    return float(stretch[max(lost[0] - 1, 0)] if len(lost) else stretch[-1])


def least_stiffness(form: Form, alpha: Sequence[float], moduli: np.ndarray, h: np.ndarray) -> np.ndarray:
    """(m,) MPa: smallest eigenvalue of d (t_1 - t_3, t_2 - t_3) / d (h_1, h_2) at h (m, 3) of volume 1."""
    K = curvature(form, alpha, h) @ moduli
    B = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
    return np.linalg.eigvalsh(B.T @ K @ B)[:, 0]
