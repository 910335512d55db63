"""Goals that run round a closed curve at a speed."""

import numpy as np
from scipy.interpolate import CubicSpline


def laps(points: np.ndarray, speed: float, count: int, run_up: float, dt: float) -> tuple[np.ndarray, int]:
    """Goals (k, n_e) at the end of each tick of dt s, and how many of them belong to the run-up. points (m, n_e):
    evenly spaced on the curve, the last before the first or equal to it; speed: laps a second, which grows evenly
    from zero during run_up s. Between points: the periodic cubic spline."""
    size = float(np.ptp(points, axis=0).max())
    if len(points) > 1 and np.abs(points[-1] - points[0]).max() <= 1e-9 * size:
        points = points[:-1]
    closed = np.concatenate([points, points[:1]])
    curve = CubicSpline(np.linspace(0.0, 1.0, len(closed)), closed, bc_type="periodic")
    before = round(run_up / dt)
    t = dt * np.arange(1, before + round(count / speed / dt) + 1)
    run_up = before * dt
    slow = speed * t**2 / (2 * run_up) if before else t
    phase = np.where(t < run_up, slow, speed * (t - run_up / 2))
    return curve(phase % 1.0), before
