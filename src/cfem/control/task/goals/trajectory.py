"""Goals: where the effector should be, one point a row, absolute positions in mm. Pure functions of numbers."""

from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

_EIGHT = 1.7601725  # largest value of sin 2x + sin x
PLANES = {"xy": (0, 1), "yz": (1, 2), "zx": (2, 0)}


def arc(centre: np.ndarray, radius: float, start: float, end: float, plane: str, goals: int) -> np.ndarray:
    """Points (goals, 3) mm, evenly spaced on a circle about centre (3,) mm, both ends included. start, end: rad from
    the plane's first axis towards its second; in 'yz', -pi/2 is straight down and 0 towards +y."""
    first, second = PLANES[plane]
    angle = np.linspace(start, end, goals)
    points = np.tile(np.asarray(centre, float), (goals, 1))
    points[:, first] += radius * np.cos(angle)
    points[:, second] += radius * np.sin(angle)
    return points


def with_approach(goals: np.ndarray, start: np.ndarray, count: int) -> np.ndarray:
    """Goals (count + m, n_e) mm: before the goals (m, n_e) as many as `count` on the straight line to them from start,
    which is the first."""
    return np.vstack([np.linspace(start, goals[0], count, endpoint=False), goals])


def along(points: np.ndarray, goals: int) -> np.ndarray:
    """Points (goals, n) mm, evenly spaced on the straight lines from each of the points (m, n) mm to the next, both
    ends included; the first alone where one is asked for."""
    lengths = np.concatenate([[0.0], np.linalg.norm(np.diff(points, axis=0), axis=1).cumsum()])
    places = np.linspace(0.0, lengths[-1], goals)
    return np.stack([np.interp(places, lengths, column) for column in points.T], axis=1)


def half_sphere(centre: np.ndarray, radius: float, turns: float, goals: int) -> np.ndarray:
    """Points (goals, 3) mm on a sphere about centre (3,) mm, from its top down to its equator, both included, by equal
    angles from the z axis and, `turns` in all, by equal angles about it."""
    share = np.linspace(0, 1, goals)
    polar, around = share * np.pi / 2, share * 2 * np.pi * turns
    out = np.sin(polar)
    return np.asarray(centre, float) + radius * np.stack([out * np.cos(around), out * np.sin(around), np.cos(polar)], 1)


def loop_of_shares(
    centre: np.ndarray, radii: np.ndarray, goals: int, shape: Literal["ellipse", "figure-eight"] = "ellipse"
) -> np.ndarray:
    """Shares (goals, n_a) on a closed curve in the pulling cube [0, 1]^n_a. ellipse: each share follows the one before
    by a quarter turn. figure-eight: all swing together twice a turn, and against each other once. Its image by FE is a
    curve that the robot can follow."""
    if shape == "figure-eight":
        turn = np.arange(goals)[:, None] * 2 * np.pi / goals
        aside = np.cos(2 * np.pi * np.arange(len(centre)) / len(centre))
        return np.asarray(centre) + np.asarray(radii) * (np.sin(2 * turn) + aside * np.sin(turn)) / _EIGHT
    turn = np.arange(goals)[:, None] * 2 * np.pi / goals - np.arange(len(centre)) * np.pi / 2
    return np.asarray(centre) + np.asarray(radii) * np.cos(turn)


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
