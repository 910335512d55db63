"""A batch of episodes: robots, goals, what differs from robot to robot, and one step of all of them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.errors import InputError
from cfem.gym.robots import FIELDS, Robots
from cfem.gym.tasks import TASKS, Goals, Scales, observation
from cfem.predict.protocol import Predictor


@dataclass(frozen=True)
class Randomised:
    """What differs from episode to episode. parameters: whether those of the model are drawn from their ranges; slack:
    mm, by which an actuator may be less than told, standard deviation; gain: share by which a command may be off;
    noise: mm, of each measured coordinate of the effector, new at each tick."""

    parameters: bool = True
    slack: float = 0.0
    gain: float = 0.0
    noise: float = 0.0


class World:
    """B episodes of a task. model: a predictor or the folder of one; step: share of the reach by which an action of 1
    changes a command."""

    def __init__(
        self,
        model: Predictor | Path | str,
        task: str,
        count: int,
        step: float = 0.05,
        randomised: Randomised | None = None,
        length: int | None = None,
        seed: int = 0,
    ):
        if task not in TASKS:
            raise InputError(f"there is no task '{task}'", do=f"use one of {', '.join(TASKS)}")
        if not isinstance(model, Predictor):
            from cfem.predict.load import load_model

            model = load_model(Path(model))
        kind = TASKS[task]
        self.robots = Robots(model, kind.compliance)
        self.model, self.count, self.name = model, count, task
        self.randomised = Randomised() if randomised is None else randomised
        self.task = kind(self.robots, np.random.default_rng(seed))
        self.length = self.task.length if length is None else length
        low, high = np.asarray(model.reach, float).T
        self.scales = Scales(self.task.scale, self.task.near, step * (high - low), low, high)
        self.rng = np.random.default_rng(seed)
        n_e, n_a = model.rows.n_e, model.rows.n_a
        path = np.zeros((count, self.length + 1 if task == "follow" else 1, n_e))
        self.goals = Goals(path, np.zeros((count, n_e)), np.zeros(count))
        self.states, self.u, self.t = self.robots.start(count), np.zeros((count, n_a)), np.zeros(count, int)
        self.p = self.robots.random_parameters(self.rng, count)
        self.slack, self.gain = np.zeros((count, n_a)), np.ones((count, n_a))

    @property
    def sizes(self) -> tuple[int, int]:
        """Of an observation and of an action."""
        return 4 * self.model.rows.n_e + self.model.rows.n_a, self.model.rows.n_a

    def reset(self, which: np.ndarray) -> None:
        """New episodes for the robots `which` (k,), each at a random place."""
        k, rng, kinds = len(which), self.rng, self.randomised
        self.task.begin(self.goals, which, rng)
        self.t[which] = 0
        self.u[which] = self.scales.low + rng.random((k, self.u.shape[1])) * (self.scales.reach - self.scales.low) * 0.6
        if kinds.parameters and self.p.shape[1]:
            self.p[which] = self.robots.random_parameters(rng, k)
        elif self.p.shape[1]:
            self.p[which] = [one.reference for one in self.model.parameters]
        self.slack[which] = kinds.slack * np.abs(rng.standard_normal((k, self.u.shape[1])))
        self.gain[which] = 1.0 + kinds.gain * rng.uniform(-1, 1, (k, self.u.shape[1]))
        start = self.robots.start(k)
        moved = self.robots.move(start, self._felt(which), self.p[which] if self.p.shape[1] else None)
        for name in FIELDS:
            getattr(self.states, name)[which] = getattr(moved, name)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """actions (B, n_a) -> rewards (B,), errors (B,) mm, and whose episode is over (B,)."""
        scales = self.scales
        move = np.clip(np.nan_to_num(np.asarray(actions, float)), -1.0, 1.0) * scales.step
        self.u = np.clip(self.u + move, scales.low, scales.reach)
        self.states = self.robots.move(self.states, self._felt(slice(None)), self.p if self.p.shape[1] else None)
        self.t += 1
        errors = self.task.errors(self.states, self.goals, self.t)
        rewards = np.exp(-errors / scales.near) - errors / scales.scale
        return rewards, errors, self.t >= self.length

    def observe(self) -> np.ndarray:
        """(B, n) float32."""
        tip = self.task.tip(self.states, self.goals)
        if self.randomised.noise:
            tip = tip + self.randomised.noise * self.rng.standard_normal(tip.shape)
        ahead = self.task.ahead(self.states, self.goals, self.t)
        return observation(self.scales, tip, self.u, self.goals.now(self.t), ahead)

    def _felt(self, which: np.ndarray | slice) -> np.ndarray:
        felt = self.u[which] * self.gain[which] - self.slack[which]
        return np.maximum(felt, self.scales.low)
