"""A finger with one cable in closed form, for every length L, Poisson's ratio and modulus: an arc of L mm that the
cable bends by s c(nu) / 12 rad, Psi = E k(L, nu) (s^2 / 2 + s^4 / 4000), and all identities between W and Psi exact."""

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.parameters import Parameter
from cfem.core.errors import NumericalError
from cfem.parametric.differences import Stencil
from cfem.parametric.states import States

ROWS = Rows(("tip.x", "tip.y", "tip.z"), ("cable",))
LENGTH = Parameter("length", "geometry.length", "mm", 30.0, 50.0, 40.0)
POISSON = Parameter("poisson", "material.poisson", "1", 0.40, 0.499, 0.45, "log(1-2p)")
YOUNG = Parameter("young", "material.young", "MPa", 1.0, 10.0, 3.0, "log", exact=True)


class Arc:
    """limit: mm of cable beyond which there is no state."""

    rows, parameters = ROWS, (LENGTH, POISSON, YOUNG)
    reach, length, stencil = np.array([[0.0, 20.0]]), 40.0, Stencil(6, 0.01)

    def __init__(self, limit: float = np.inf):
        self.limit, self.asked = limit, 0

    def at(self, kind, u, p):
        p = np.asarray(p, float)
        u = np.broadcast_to(u, (len(p), 1))
        self.asked += len(p)
        L, nu, E = p.T
        k = E * 0.3 * (40 / L) * (1 + 0.5 * (nu - 0.4))
        s = u[:, 0] if kind == "displacement" else _stretch(u[:, 0] / k)
        if np.abs(s).max(initial=0) > self.limit:
            raise NumericalError("beyond the limit")
        lam, stiffness = k * (s + s**3 / 1000), k * (1 + 3 * s**2 / 1000)
        bend = (1 + 2 * (nu - 0.4) ** 2) / 12
        a = s * bend
        a = np.where(np.abs(a) < 1e-6, 1e-6, a)
        e = np.stack([0.05 * nu * s, L * (1 - np.cos(a)) / a, L * (1 - np.sin(a) / a)], axis=1)
        da = np.stack([L * (a * np.sin(a) - 1 + np.cos(a)) / a**2, L * (np.sin(a) - a * np.cos(a)) / a**2], axis=1)
        g = np.concatenate([0.05 * nu[:, None], da * bend[:, None]], axis=1)
        W = np.zeros((len(p), 4, 4))
        W[:, 3, 3] = 1 / stiffness
        W[:, :3, 3] = W[:, 3, :3] = g / stiffness[:, None]
        C = np.stack([2 + 0 * L, 1 + L / 100, 0.1 + 0 * L], axis=1) / E[:, None]
        W[:, :3, :3] = C[:, :, None] * np.eye(3) + g[:, :, None] * g[:, None] / stiffness[:, None, None]
        free = np.concatenate([e, s[:, None]], axis=1) - W[:, :, 3] * lam[:, None]
        rest = np.stack([0 * L, 10 + 0 * L, -L], axis=1)
        return States(ROWS, W, free, lam[:, None], p, rest)

    def false_change(self, kind, states):
        return None  # exact but for rounding


A = Parameter("A", "material.young", "MPa", 0.5, 2.0, 1.0, "log")
B = Parameter("B", "materials.0.material.young", "MPa", 1.0, 6.0, 3.0, "log")


class Halves:
    """A bar of two halves of moduli A and B in closed form: the cable shortens them in the ratio of their softness,
    which the effectors' motion is of, and pulls with a spring's force. wrong: mm, the stated error of its motion, which
    depends on A B; weight: N, that of the tip."""

    rows, parameters = ROWS, (A, B)
    reach, length, stencil = np.array([[0.0, 10.0]]), 40.0, Stencil(6, 0.01)

    def __init__(self, wrong: float = 0.0, weight: float = 0.0):
        self.wrong, self.weight = wrong, weight

    def at(self, kind, u, p):
        (a, b), s = np.asarray(p, float).T, np.broadcast_to(u, (len(p), 1))[:, 0]
        share = b / (a + b)
        e = np.stack([s * share, s * share**2, self.weight * (1 / a + 1 / b)], axis=1)
        e += self.wrong * np.sin(3 * np.log(a * b))[:, None]
        lam = (s * a * b / (a + b))[:, None]
        free = np.concatenate([e, s[:, None]], axis=1)
        return States(ROWS, np.zeros((len(p), 4, 4)), free, lam, np.asarray(p, float), np.zeros((len(p), 3)))

    def false_change(self, kind, states):
        return np.full((len(states), 3), 2 * self.wrong), np.zeros((len(states), 1))


def _stretch(f: np.ndarray) -> np.ndarray:
    """s with s + s^3 / 1000 = f."""
    s = f.copy()
    for _ in range(60):
        s -= (s + s**3 / 1000 - f) / (1 + 3 * s**2 / 1000)
    return s
