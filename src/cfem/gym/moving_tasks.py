"""What robots that move shall do, and what their policies observe: goals ahead, and a few of the last samples and
commands, from which speeds follow.

    (goal - x) / scale                the goal of the end of this tick, less the newest sample, n_e
    (goal - x) / (5 near)             the same near the goal, n_e, at most 1
    (goal' - goal) / (5 near)         how goals go on, tick by tick, n_e each (`ahead` - 1 of them)
    (x - x_rest) / scale              the newest sample, n_e
    (x - x') / (5 near)               how samples changed, newest first, n_e each (`history` - 1 of them)
    2 u / reach - 1                   the last command, n_a
    (u - u') / step                   how commands changed, newest first, n_a each (`history` - 1 of them)"""

import numpy as np

from cfem.gym.robots import Robots
from cfem.gym.tasks import LARGEST, Follow, Goals, Reach, Scales


def moving_observation(scales: Scales, tips: np.ndarray, us: np.ndarray, goals: np.ndarray) -> np.ndarray:
    """Observation (B, n) float32 of robots that move: tips (B, history, n_e) mm from rest, us (B, history, n_a), both
    newest first; goals (B, ahead, n_e), the next first."""
    errors, per_robot, close = goals[:, 0] - tips[:, 0], (len(tips), -1), 5 * scales.near
    parts = [
        errors / scales.scale,
        np.clip(errors / close, -1.0, 1.0),
        ((goals[:, 1:] - goals[:, :-1]) / close).reshape(per_robot),
        tips[:, 0] / scales.scale,
        ((tips[:, :-1] - tips[:, 1:]) / close).reshape(per_robot),
        2.0 * (us[:, 0] - scales.low) / (scales.reach - scales.low) - 1.0,
        ((us[:, :-1] - us[:, 1:]) / scales.step).reshape(per_robot),
    ]
    observed = np.concatenate(parts, axis=1, dtype=np.float32, casting="same_kind")
    return np.clip(observed, -LARGEST, LARGEST, out=observed)


class MovingReach(Reach):
    """Goals that stay for an episode."""

    length = 100

    def __init__(self, robots: Robots, p: np.ndarray, rng: np.random.Generator, tick: float):
        super().__init__(robots, p, rng)


class MovingFollow(Follow):
    """Goals on closed curves, the places of rest under forces that are sums of two harmonics; slowest to fastest laps a
    second, Hz, as many of each octave; the speed grows from zero in a run-up of at most a half second."""

    length, slowest, fastest = 200, 0.2, 8.0

    def __init__(self, robots: Robots, p: np.ndarray, rng: np.random.Generator, tick: float):
        self._tick = tick
        super().__init__(robots, p, rng)

    def _shares(self, rng: np.random.Generator, size: tuple[int, int]) -> np.ndarray:
        """Shares of the largest forces along closed curves, (length + 1, curves, n_a), run at speeds that grow from
        rest."""
        t = self._tick * np.arange(self.length + 1)[:, None, None]
        speed = self.slowest * (self.fastest / self.slowest) ** rng.random((size[0], 1))
        run_up = rng.uniform(self._tick, 0.5, (size[0], 1))
        turn = 2 * np.pi * speed * np.where(t < run_up, t**2 / (2 * run_up), t - run_up / 2)
        turn = turn * rng.choice([-1.0, 1.0], (size[0], 1))
        shares = rng.uniform(0.2, 0.4, size)[None]
        for harmonic in (1, 2):
            radius, phase = rng.uniform(0.0, 0.16, size), rng.uniform(0, 2 * np.pi, size)
            shares = shares + radius * np.cos(harmonic * turn + phase)
        return np.maximum(shares, 0.02)


def ahead_of(goals: Goals, t: np.ndarray, ahead: int) -> np.ndarray:
    """Goals (B, ahead, n_e) of the ends of the ticks that follow t (B,)."""
    if goals.path.shape[1] == 1:
        return np.repeat(goals.path, ahead, axis=1)
    count, ticks, n_e = goals.path.shape
    rows = np.minimum(t[:, None] + 1 + np.arange(ahead), ticks - 1) + ticks * np.arange(count)[:, None]
    return goals.path.reshape(-1, n_e).take(rows, axis=0)


MOVING = {"moving-reach": MovingReach, "moving-follow": MovingFollow}
