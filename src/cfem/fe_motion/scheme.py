"""The generalised-alpha scheme: implicit, of second order, with damping of what a step does not resolve.

In the form for constrained systems (Arnold and Bruels, Multibody Syst. Dyn. 18, 2007): the equations hold at the end of
each step with the acceleration a there, and an acceleration a* that lags behind carries x and v on:

    (1 - alpha_m) a*' + alpha_m a* = (1 - alpha_f) a' + alpha_f a
    x' = x + dt v + dt^2 ((1/2 - beta) a* + beta a*')        v' = v + dt ((1 - gamma) a* + gamma a*')

All are of nodes; held nodes and rigid groups bind the positions x' that the equations are solved for."""

from dataclasses import dataclass

import numpy as np

from cfem.mechanics.viscosity import ViscousMemory


@dataclass(frozen=True)
class Motion:
    """State of a motion.

    t: s
    x, v, a: (n, 3) mm, mm/s, mm/s^2 of the nodes
    lag: a* of the scheme
    pressure: (m,) MPa of the elements
    lam: (n_active,) multipliers
    memory: of the overstress, None without viscosity"""

    t: float
    x: np.ndarray
    v: np.ndarray
    a: np.ndarray
    lag: np.ndarray
    pressure: np.ndarray
    lam: np.ndarray
    memory: ViscousMemory | None = None


@dataclass(frozen=True)
class Scheme:
    """The scheme. rho: spectral radius at frequencies far above 1/dt, 1 (nothing is damped) to 0 (all of it in one
    step)."""

    rho: float = 0.8

    @property
    def alpha_m(self) -> float:
        return (2 * self.rho - 1) / (self.rho + 1)

    @property
    def alpha_f(self) -> float:
        return self.rho / (self.rho + 1)

    @property
    def gamma(self) -> float:
        return 0.5 - self.alpha_m + self.alpha_f

    @property
    def beta(self) -> float:
        return (0.5 + self.gamma) ** 2 / 4

    def acceleration(self, motion: Motion, dt: float) -> tuple[float, np.ndarray, np.ndarray]:
        """Terms c (1/s^2), y (n, 3) mm and h (n, 3) mm/s^2 of a' = c (x' - y) + h."""
        known = motion.x + dt * motion.v + dt**2 * (0.5 - self.beta) * motion.lag
        c = (1 - self.alpha_m) / (1 - self.alpha_f) / (self.beta * dt**2)
        return c, known, (self.alpha_m * motion.lag - self.alpha_f * motion.a) / (1 - self.alpha_f)

    def after(self, motion: Motion, dt: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Velocities v', accelerations a' and a*' of the step that ends at positions x (n, 3)."""
        c, known, h = self.acceleration(motion, dt)
        lag = (x - known) / (self.beta * dt**2)
        v = motion.v + dt * ((1 - self.gamma) * motion.lag + self.gamma * lag)
        return v, c * (x - known) + h, lag

    def error(self, motion: Motion, dt: float, lag: np.ndarray) -> float:
        """Estimate, mm, of what the step has left out of the positions, at the node where it is largest: the change of
        the acceleration (Zienkiewicz and Xie, Earthquake Eng. Struct. Dyn. 20, 1991)."""
        change = np.sqrt(((lag - motion.lag) ** 2).sum(axis=1).max())
        return float(dt**2 * max(abs(self.beta - 1 / 6), 1 / 12) * change)
