"""The element of a geometrically exact rod (Reissner 1981; Simo, CMAME 49, 1985) whose strain is constant.

An element joins two rigid sections with frames (c, R), R turned since rest. Its strain is the logarithm of their
relative motion on SE(3), a screw along which all sections between them lie (Borri and Bottasso, IJNME 37, 1994;
Sonneville, Cardona and Bruls, CMAME 268, 2014):

    theta = log(Ra^T Rb)        V(theta) u = Ra^T (cb - ca) = p        e = (u - (h, 0, 0), theta)

with V the left Jacobian of SO(3), V^-1 p = p - theta x p / 2 + c theta x (theta x p). It is objective, needs no reduced
integration, and is exact where the strain is constant: under end moments, and under pressure in chambers along the rod.
Axes are those of the rest shape, x along the rod. Motions are (dc, omega) of either section, R -> exp[omega] R; all
arrays run over the m elements."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import zeta

_TERMS = 30  # for |theta| up to pi to rounding


_POWERS = np.arange(_TERMS)
# c(s), s = theta^2, of V^-1 = 1 - [theta] / 2 + c [theta]^2: c = (1 - (t / 2) cot(t / 2)) / t^2
_C = 2 * zeta(2 * _POWERS + 2) / (2 * np.pi) ** (2 * _POWERS + 2)
# columns: coefficients of c, c', c'' by the power of s
_SERIES = np.stack(
    [
        _C,
        np.append(_C[1:] * _POWERS[1:], 0.0),
        np.append(_C[2:] * _POWERS[2:] * _POWERS[1:-1], [0.0, 0.0]),
    ],
    axis=1,
)


@dataclass(frozen=True)
class Stretch:
    """e (m, 6): mm, rad; gradient (m, 6, 12) by the motions of both sections; the rest is what `curvature` needs: Ra,
    Rb, theta, p, and c, c', c''."""

    e: np.ndarray
    gradient: np.ndarray
    Ra: np.ndarray
    Rb: np.ndarray
    theta: np.ndarray
    p: np.ndarray
    c: np.ndarray


def stretch(ca: np.ndarray, Ra: np.ndarray, cb: np.ndarray, Rb: np.ndarray, h: np.ndarray) -> Stretch:
    """Of sections at ca, cb (m, 3) mm with rotations Ra, Rb (m, 3, 3), h (m,) mm apart at rest."""
    Rat = Ra.swapaxes(1, 2)
    p = (Rat @ (cb - ca)[:, :, None])[:, :, 0]
    theta = _log(Rat @ Rb)
    c = (theta**2).sum(axis=1)[:, None] ** _POWERS @ _SERIES
    turn = _cross(theta)
    twice = c[:, :1, None] * (turn @ turn)
    left = np.eye(3) - turn / 2 + twice  # J_l^-1 = V^-1
    right = np.eye(3) + turn / 2 + twice
    G = _slope(theta, p, c, 0.5)
    e = np.concatenate([(left @ p[:, :, None])[:, :, 0], theta], axis=1)
    e[:, 0] -= h
    gradient = np.zeros((len(h), 6, 12))
    gradient[:, :3, 6:9] = left @ Rat
    gradient[:, :3, :3] = -gradient[:, :3, 6:9]
    gradient[:, :3, 3:6] = (left @ _cross(p) - G @ left) @ Rat
    gradient[:, 3:, 3:6] = -left @ Rat
    gradient[:, 3:, 9:] = right @ Rb.swapaxes(1, 2)
    gradient[:, :3, 9:] = G @ gradient[:, 3:, 9:]
    return Stretch(e, gradient, Ra, Rb, theta, p, c)


def screw(e: np.ndarray, h: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """p (m, 3) mm and rotation (m, 3, 3) of the relative motions with stretch e (m, 6): the inverse of `stretch`."""
    theta, u = e[:, 3:], e[:, :3].copy()
    u[:, 0] += h
    turn = Rotation.from_rotvec(theta).as_matrix()
    s = (theta**2).sum(axis=1)
    t = np.sqrt(s)
    small = s < 1e-6
    safe = np.where(small, 1.0, s)
    # V = 1 + a [theta] + b [theta]^2
    a = np.where(small, 0.5 - s / 24, (1 - np.cos(t)) / safe)
    b = np.where(small, 1 / 6 - s / 120, (t - np.sin(t)) / (safe * np.where(small, 1.0, t)))
    spin = _cross(theta)
    V = np.eye(3) + a[:, None, None] * spin + b[:, None, None] * (spin @ spin)
    return (V @ u[:, :, None])[:, :, 0], turn


def curvature(at: Stretch, weights: np.ndarray) -> np.ndarray:
    """(m, 12, 12) second derivative of weights . e, weights (m, 6), by the motions of both sections: of straight lines
    (dc, omega), R -> exp[omega] R. With (alpha, beta) = (Ra^T omega_a, Rb^T omega_b) and tau = Ra^T (dcb - dca),

        theta' = Jr^-1 beta - Jl^-1 alpha            theta'' = Jr^-1' beta - Jl^-1' alpha
        p' = tau - alpha x p                         p'' = alpha x (alpha x p) - 2 alpha x tau"""
    theta, p, c, n = at.theta, at.p, at.c, weights[:, :3]
    m = len(theta)
    turn = _cross(theta)
    twice = c[:, :1, None] * (turn @ turn)
    left, right = np.eye(3) - turn / 2 + twice, np.eye(3) + turn / 2 + twice
    by_p = (right @ n[:, :, None])[:, :, 0]  # V^-T n
    by_theta = weights[:, 3:] + (n[:, None] @ _slope(theta, p, c, 0.5))[:, 0]
    to_theta = np.zeros((m, 3, 9))
    to_theta[:, :, 3:6], to_theta[:, :, 6:] = -left, right
    to_p = np.zeros((m, 3, 9))
    to_p[:, :, :3], to_p[:, :, 3:6] = np.eye(3), _cross(p)
    H = to_p.swapaxes(1, 2) @ _slope(theta, n, c, -0.5) @ to_theta
    H[:, 6:] += _slope(theta, by_theta, c, 0.5) @ to_theta / 2
    H[:, 3:6] -= _slope(theta, by_theta, c, -0.5) @ to_theta / 2
    H += H.swapaxes(1, 2)
    H += to_theta.swapaxes(1, 2) @ _second(theta, n, p, c) @ to_theta
    outer = by_p[:, :, None] * p[:, None]
    H[:, 3:6, 3:6] += (outer + outer.swapaxes(1, 2)) / 2 - np.trace(outer, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    across = _cross(by_p)
    H[:, :3, 3:6] -= across
    H[:, 3:6, :3] += across
    Rat, Rbt = at.Ra.swapaxes(1, 2), at.Rb.swapaxes(1, 2)
    T = np.zeros((m, 9, 12))
    T[:, :3, :3], T[:, :3, 6:9] = -Rat, Rat
    T[:, 3:6, 3:6], T[:, 6:, 9:] = Rat, Rbt
    return T.swapaxes(1, 2) @ H @ T


def _slope(theta: np.ndarray, v: np.ndarray, c: np.ndarray, half: float) -> np.ndarray:
    """(m, 3, 3) derivative by theta of -half theta x v + c theta x (theta x v)."""
    along = (theta * v).sum(axis=1)
    twice = theta * along[:, None] - v * (theta**2).sum(axis=1)[:, None]
    out = half * _cross(v)
    out += c[:, :1, None] * (theta[:, :, None] * v[:, None] - 2 * v[:, :, None] * theta[:, None])
    out += 2 * c[:, 1:2, None] * (twice[:, :, None] * theta[:, None])
    out += (c[:, 0] * along)[:, None, None] * np.eye(3)
    return out


def _second(theta: np.ndarray, n: np.ndarray, p: np.ndarray, c: np.ndarray) -> np.ndarray:
    """(m, 3, 3) second derivative by theta of n . V^-1 p, of c Q with Q = n . (theta x (theta x p))."""

    def dot(a, b):
        return (a * b).sum(axis=1)[:, None]

    def symmetric(a, b):
        outer = a[:, :, None] * b[:, None]
        return outer + outer.swapaxes(1, 2)

    c0, c1, c2 = (c[:, k : k + 1] for k in range(3))
    Q = dot(n, theta) * dot(theta, p) - dot(theta, theta) * dot(n, p)
    first = n * dot(p, theta) + p * dot(n, theta) - 2 * theta * dot(n, p)
    out = c0[:, :, None] * symmetric(n, p) + symmetric(2 * c1 * theta, first) + symmetric(2 * c2 * Q * theta, theta)
    return out + (2 * c1 * Q - 2 * c0 * dot(n, p))[:, :, None] * np.eye(3)


def _log(R: np.ndarray) -> np.ndarray:
    """(m, 3) rotation vectors of R (m, 3, 3), shorter than pi."""
    axial = np.stack([R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1) / 2
    sine = np.sqrt((axial**2).sum(axis=1))
    angle = np.arctan2(sine, (np.trace(R, axis1=1, axis2=2) - 1) / 2)
    factor = np.where(sine > 1e-8, angle / np.where(sine > 1e-8, sine, 1.0), 1.0)
    return axial * factor[:, None]


def _cross(v: np.ndarray) -> np.ndarray:
    """(m, 3, 3) [v] of v (m, 3)."""
    out = np.zeros((len(v), 3, 3))
    out[:, 2, 1], out[:, 0, 2], out[:, 1, 0] = v.T
    out[:, 1, 2], out[:, 2, 0], out[:, 0, 1] = -v.T
    return out
