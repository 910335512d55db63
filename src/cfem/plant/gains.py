"""Gains that the closed loop bears: the inverse step cancels the robot, and what is left is an integrator that hears of
its own commands late.

A model that is right up to a factor answers the corrected goal g_k with x_k = m g_k + const; m = 1 for a perfect
model, 1 / (1 + s) for forces into a robot stiffer by the share s. A sample taken `late` + 1 samples before the command
that it corrects gives the loop

    L(z) = m (K_P + K_I z / (z - 1)) z^-(late + 1)

With K_P = 0 the closed loop's polynomial is z^(late + 1) - z^late + m K_I, stable for
0 < m K_I < 2 sin(pi / (2 (2 late + 1))) (Levin and May 1976; Jury's test gives the same)."""

from dataclasses import dataclass

import numpy as np

PHASE_MARGIN = np.pi / 3  # rad


@dataclass(frozen=True)
class Gains:
    """Gains of a proportional-integral law, dimensionless, per sample."""

    proportional: float = 0.0
    integral: float | None = None  # None: what leaves the phase margin at the samples' delay and interval
    bound: float = np.inf  # mm, the longest that K_I sum(e) may become
    phase_margin: float = PHASE_MARGIN  # rad

    def integral_at(self, late: int) -> float:
        """K_I for samples that come so late."""
        return integral_for(self.phase_margin, late) if self.integral is None else self.integral


def stable_below(late: int) -> float:
    """m K_I at which the loop with K_P = 0 becomes unstable, where samples come so late: without phase margin."""
    return integral_for(0.0, late)


def late_samples(delay: int, ticks_a_sample: float) -> int:
    """Number of samples taken before the one that first shows a correction; delay: ticks from sample to controller,
    which answers in the tick after."""
    return max(int(np.ceil((delay + 1) / ticks_a_sample)) - 1, 0)


def integral_for(phase_margin: float, late: int) -> float:
    """Gain m K_I with that phase margin (rad, in (0, pi/2)) and K_P = 0: |L| = 1 at w = 2 asin(m K_I / 2), where the
    phase is -(pi/2 + (late + 1/2) w)."""
    return 2 * np.sin((np.pi / 2 - phase_margin) / (2 * late + 1))
