"""The cameras' frame laid on the scene's: the rigid motion y = R x + t that fits markers to their places best (Kabsch,
Acta Cryst. A32, 1976), and its covariance.

With residuals of variance s^2 a coordinate, a turn by the small vector w about the markers' mean and a shift of it have
the covariances s^2 (sum |a|^2 1 - a a^T)^-1 and s^2 / n, a the places from their mean and s^2 = |residuals|^2 / (3 n -
6)."""

from dataclasses import dataclass

import numpy as np

from cfem.core.errors import InputError

_MIRRORED = 0.3  # of the residual: a reflection that fits so much better is what the frame is
_OTHER_UNIT = 2.0  # ratio of distances between markers beyond which the unit is another
_NAMES = {1000.0: "metres", 0.001: "micrometres", 10.0: "centimetres", 25.4: "inches"}


@dataclass(frozen=True)
class Registration:
    """turn (3, 3), shift (3,) mm; residual: root mean square distance, mm; turn_sd (3,) rad and shift_sd (3,) mm of the
    markers' mean, nan from fewer than three markers more than needed; count: of markers."""

    turn: np.ndarray
    shift: np.ndarray
    residual: float
    turn_sd: np.ndarray
    shift_sd: np.ndarray
    count: int

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """(..., 3) mm from the cameras' frame to the scene's."""
        return x @ self.turn.T + self.shift


def register(seen: np.ndarray, places: np.ndarray, source: str, tolerance: float) -> Registration:
    """seen, places: (n, 3) mm of the same markers in both frames. InputError where they are fewer than three or on one
    line, where their distances are of another unit, where the frame is left-handed, and where they do not fit within
    `tolerance` mm (root mean square)."""
    if len(seen) < 3:
        what = f"shows {len(seen)} of the markers whose places are known, and three are needed to lay its frame"
        raise InputError(what, where=source, do="state more places, or see that no marker is hidden")
    a, b = seen - seen.mean(axis=0), places - places.mean(axis=0)
    _demand_unit(a, b, source)
    turn, left = _turn(a, b, proper=True)
    spread = np.linalg.svd(b, compute_uv=False)
    if spread[1] < 1e-6 * spread[0]:
        raise InputError("the markers whose places are known lie on one line", where=source, do="state one beside it")
    if left > tolerance:
        _, mirrored = _turn(a, b, proper=False)
        if mirrored < _MIRRORED * left:
            fit = f"its markers fit to {mirrored:.2g} mm after mirroring, to {left:.2g} mm without"
            what = f"its frame is left-handed: {fit}"
            raise InputError(what, where=source, do="export it again with right-handed axes: one has its sign wrong")
        what = f"its markers miss their places by {left:.3g} mm (root mean square), more than {tolerance:g} mm"
        raise InputError(what, where=source, do="check the places, or allow more by registration.tolerance")
    n = len(a)
    variance = n * left**2 / (3 * n - 6) if n > 2 and 3 * n > 6 else np.nan
    about = np.linalg.pinv((b**2).sum() * np.eye(3) - b.T @ b)
    shift = places.mean(axis=0) - turn @ seen.mean(axis=0)
    return Registration(turn, shift, left, np.sqrt(variance * np.diag(about)), np.full(3, np.sqrt(variance / n)), n)


def _turn(a: np.ndarray, b: np.ndarray, proper: bool) -> tuple[np.ndarray, float]:
    """R that takes a to b best, and the root mean square distance left."""
    U, _, Vt = np.linalg.svd(b.T @ a)
    sign = np.sign(np.linalg.det(U @ Vt)) * (1 if proper else -1)
    turn = U @ np.diag([1.0, 1.0, sign]) @ Vt
    return turn, float(np.sqrt(((a @ turn.T - b) ** 2).sum(axis=1).mean()))


def _demand_unit(a: np.ndarray, b: np.ndarray, source: str) -> None:
    ratio = float(np.sqrt((b**2).sum() / max((a**2).sum(), 1e-300)))
    if not 1 / _OTHER_UNIT < ratio < _OTHER_UNIT:
        near = min(_NAMES, key=lambda size: abs(np.log(size / ratio)))
        guess = f", as if recorded in {_NAMES[near]}" if abs(np.log(near / ratio)) < 0.3 else ""
        what = (
            f"the distances between its markers are {1 / ratio:.3g} of what they should be{guess}: the unit is another"
        )
        raise InputError(what, where=source, do="state `unit` of the recording, such as '1 m'")
