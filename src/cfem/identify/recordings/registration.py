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
    """The motion y = turn x + shift from the cameras' frame to the scene's, and how well it is known.

    turn:     (3, 3)
    shift:    (3,) mm
    residual: mm, root mean square distance
    turn_sd:  (3,) rad standard deviations
    shift_sd: (3,) mm standard deviations, of the markers' mean"""

    turn: np.ndarray
    shift: np.ndarray
    residual: float
    turn_sd: np.ndarray
    shift_sd: np.ndarray

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Places (..., 3) mm in the scene's frame, of those in the cameras'."""
        return x @ self.turn.T + self.shift


def register(seen: np.ndarray, places: np.ndarray, source: str, tolerance: float) -> Registration:
    """The frame in which markers seen at (n, 3) mm are at their places (n, 3) mm. InputError where they are fewer than
    three or on one line, where their distances are of another unit, where the frame is left-handed, and where they do
    not fit within `tolerance` mm (root mean square)."""
    if len(seen) < 3:
        what = f"shows {len(seen)} of the markers whose places are known, and three are needed to lay its frame"
        raise InputError(what, where=source, do="state more places, or see that no marker is hidden")
    b = places - places.mean(axis=0)
    _demand_unit(seen - seen.mean(axis=0), b, source)
    turn, shift = best_motion(seen, places)
    residual = _residual(seen, places, turn, shift)
    extent = np.linalg.svd(b, compute_uv=False)
    if extent[1] < 1e-6 * extent[0]:
        raise InputError("the markers whose places are known lie on one line", where=source, do="state one beside it")
    if residual > tolerance:
        mirrored = _residual(seen, places, *best_motion(seen, places, mirror=True))
        if mirrored < _MIRRORED * residual:
            fit = f"its markers fit to {mirrored:.2g} mm after mirroring, to {residual:.2g} mm without"
            what = f"its frame is left-handed: {fit}"
            raise InputError(what, where=source, do="export it again with right-handed axes: one has its sign wrong")
        what = f"its markers miss their places by {residual:.3g} mm (root mean square), more than {tolerance:g} mm"
        raise InputError(what, where=source, do="check the places, or allow more by registration.tolerance")
    n = len(seen)
    variance = n * residual**2 / (3 * n - 6)
    inverse_inertia = np.linalg.pinv((b**2).sum() * np.eye(3) - b.T @ b)
    turn_sd, shift_sd = np.sqrt(variance * np.diag(inverse_inertia)), np.full(3, np.sqrt(variance / n))
    return Registration(turn, shift, residual, turn_sd, shift_sd)


def best_motion(seen: np.ndarray, places: np.ndarray, mirror: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """The turn R (3, 3) and shift t (3,) for which R x + t of points x (n, 3) is nearest to their places (n, 3); with
    `mirror` R is a reflection."""
    centre, middle = seen.mean(axis=0), places.mean(axis=0)
    U, _, Vt = np.linalg.svd((places - middle).T @ (seen - centre))
    handed = np.sign(np.linalg.det(U @ Vt)) * (-1 if mirror else 1)
    turn = U @ np.diag([1.0, 1.0, handed]) @ Vt
    return turn, middle - turn @ centre


def _residual(seen: np.ndarray, places: np.ndarray, turn: np.ndarray, shift: np.ndarray) -> float:
    """Root mean square distance (mm) of moved points from their places."""
    return float(np.sqrt(((seen @ turn.T + shift - places) ** 2).sum(axis=1).mean()))


def _demand_unit(a: np.ndarray, b: np.ndarray, source: str) -> None:
    """Raises InputError where points a are of another size than b, both (n, 3) from their mean."""
    ratio = float(np.sqrt((b**2).sum() / max((a**2).sum(), 1e-300)))
    if not 1 / _OTHER_UNIT < ratio < _OTHER_UNIT:
        near = min(_NAMES, key=lambda size: abs(np.log(size / ratio)))
        guess = f", as if recorded in {_NAMES[near]}" if abs(np.log(near / ratio)) < 0.3 else ""
        what = (
            f"the distances between its markers are {1 / ratio:.3g} of what they should be{guess}: the unit is another"
        )
        raise InputError(what, where=source, do="state `unit` of the recording, such as '1 m'")
