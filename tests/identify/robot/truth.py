"""What the finger in closed form would be measured to do."""

import numpy as np
from parametric.synthetic import Arc

from cfem.identify.robot.measurements import Measurements

PULLS = np.array([[0.0], [5.0], [10.0]])


def measured(p, u=PULLS, kind="displacement", positions=True, dual=False, noise=(0.0, 0.0), seed=0) -> Measurements:
    """Of the robot p (n_p,) at u (m, 1); noise: standard deviations of effectors and of the dual."""
    states = Arc().at(kind, u, np.tile(p, (len(u), 1)))
    rng = np.random.default_rng(seed)
    x_e = states.x_e + noise[0] * rng.standard_normal(states.x_e.shape)
    other = states.lam if kind == "displacement" else states.delta_a
    other = other + noise[1] * rng.standard_normal(other.shape)
    no_e, no_a = np.full_like(x_e, np.nan), np.full_like(other, np.nan)
    return Measurements(kind, u, x_e if positions else no_e, no_e, other if dual else no_a)
