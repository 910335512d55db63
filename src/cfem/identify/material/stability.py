"""Drucker's condition for an incompressible law: work of every small increment of stress is positive, d t : d h > 0."""

from collections.abc import Mapping, Sequence

import numpy as np

from cfem.identify.material.forms import MODES, Form, Mode, curvature, log_stretches

_POINTS = 241


def stable_to(form: Form, alpha: Sequence[float], moduli: np.ndarray, most: float) -> dict[str, float]:
    """Stretch up to which the law is stable in tension of every mode and in uniaxial compression, at most `most`; of
    compression, down to which, at least 1 / most."""
    tension = np.exp(np.linspace(0.0, np.log(most), _POINTS))
    tests: dict[str, tuple[Mode, np.ndarray]] = {mode: (mode, tension) for mode in MODES}
    tests["compression"] = ("uniaxial", 1 / tension)
    return {name: _last_stable(form, alpha, moduli, mode, stretch) for name, (mode, stretch) in tests.items()}


def is_stable_to(limits: Mapping[str, float], most: float) -> bool:
    """True where the limits of `stable_to` reach a stretch in every mode."""
    wanted = {name: 1 / most if name == "compression" else most for name in limits}
    return all(bool(np.isclose(limit, wanted[name])) for name, limit in limits.items())


def least_stiffness(form: Form, alpha: Sequence[float], moduli: np.ndarray, h: np.ndarray) -> np.ndarray:
    """Smallest eigenvalues (m,) MPa of d (t_1 - t_3, t_2 - t_3) / d (h_1, h_2) at h (m, 3) of volume 1."""
    K = curvature(form, alpha, h) @ moduli
    B = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, -1.0]])
    return np.linalg.eigvalsh(B.T @ K @ B)[:, 0]


def _last_stable(form: Form, alpha: Sequence[float], moduli: np.ndarray, mode: Mode, stretch: np.ndarray) -> float:
    """The last of the stretches (m,) before the law is unstable."""
    unstable = np.flatnonzero(~(least_stiffness(form, alpha, moduli, log_stretches(mode, stretch)) > 0))
    return float(stretch[max(unstable[0] - 1, 0)] if len(unstable) else stretch[-1])
