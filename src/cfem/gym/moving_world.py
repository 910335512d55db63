"""A batch of episodes of robots that move: as `cfem.gym.world`, with inertia, viscosity, and sensors that are late."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cfem.core.errors import InputError
from cfem.gym.moving_robots import MovingRobots
from cfem.gym.moving_tasks import MOVING, ahead_of, moving_observation
from cfem.gym.tasks import Goals, Scales
from cfem.gym.world import demand_number, randomised
from cfem.motion.model import MotionModel
from cfem.predict.protocol import Predictor

POOL = 4096  # goals that there are
LEFT = 1.2  # half widths of the learned box, beyond which nothing is known of a robot
GONE = -10.0  # reward of leaving it


@dataclass(frozen=True)
class MovingRandomised:
    """Numbers that differ from episode to episode."""

    stiffness: float = 0.15  # share by which the robot's may be more or less than the model's
    viscosity: float = 0.3  # likewise
    delay: int = 1  # ticks by which samples may be late
    noise: float = 0.1  # mm, of each coordinate of a sample


class MovingWorld:
    """B episodes of a task of robots that move."""

    def __init__(
        self,
        model: MotionModel | Path | str,
        task: str,
        count: int,
        command: str = "force",
        rate: float = 100.0,
        substeps: int = 1,
        step: float = 0.2,
        largest: float = 0.65,
        randomise: MovingRandomised | dict[str, Any] | None = None,
        length: int | None = None,
        seed: int = 0,
        ahead: int = 8,
        history: int = 4,
    ):
        """Batch of `count` robots at a task.

        model: one that moves, or its folder
        command: 'force' or 'displacement'
        rate, substeps: ticks a second, Hz, and steps in time of each
        step: share of the reach by which an action of 1 changes a command
        largest: share of the training's largest command that may be commanded
        randomise: how robots differ from the model: a `MovingRandomised` or its keys
        length: ticks of an episode, the task's unless given
        seed: of the goals that there are
        ahead: goals that are observed
        history: samples and commands that are observed"""
        if task not in MOVING or command not in ("force", "displacement"):
            do = f"use one of {', '.join(MOVING)}, and command force or displacement"
            raise InputError(f"there is no task '{task}' with command '{command}'", do=do)
        demand_number("step", step, positive=True, most=1.0)
        for name, value in {"rate": rate, "substeps": substeps, "largest": largest, "length": length}.items():
            demand_number(name, value, positive=True)
        if min(ahead, history) < 1:
            raise InputError(f"ahead and history must be at least 1, got {ahead} and {history}")
        if not isinstance(model, MotionModel):
            from cfem.motion.load import load_motion

            model = load_motion(Path(model))
        self.robots = MovingRobots(model, command, 1.0 / rate, substeps)
        self.model, self.count, self.name, self.command = model, count, task, command
        self.randomised = randomised(MovingRandomised, randomise)
        self.ahead, self.history, self.tick = ahead, history, 1.0 / rate
        rng = np.random.default_rng(seed)
        self.task = MOVING[task](self.robots.static, np.zeros((POOL, 0)), rng, self.tick)
        self.length = self.task.length if length is None else length
        low, high = self._bounds(largest)
        self.scales = Scales(self.task.scale, self.task.near, step * (high - low), low, high)
        self.rng = np.random.default_rng(seed)
        n_e, n_a = model.rows.n_e, model.rows.n_a
        self.goals = Goals.of(self.task, count, n_e)
        self.u, self.t, self.delay = np.tile(low, (count, 1)), np.zeros(count, int), np.zeros(count, int)
        self.states = self.robots.standing(self.u, np.ones(count), np.ones(count))
        self.samples = np.zeros((count, history + self.randomised.delay, n_e))
        self.commands = np.zeros((count, history, n_a))

    def _bounds(self, largest: float) -> tuple[np.ndarray, np.ndarray]:
        model = self.model.static
        if self.command == "displacement":
            low, high = np.asarray(model.reach, float).T
        else:
            high = self.robots.static.largest_force
            low = np.zeros_like(high) if self.robots.static.pulls else -high
        return low, low + largest * (high - low)

    @property
    def predictor(self) -> Predictor:
        """The model of the robots at rest."""
        return self.model.static

    @property
    def delta_a(self) -> np.ndarray:
        """Displacements (B, n_a) mm of the actuators now."""
        return self.robots.displacements_of(self.states)

    @property
    def sizes(self) -> tuple[int, int]:
        """Sizes of an observation and of an action."""
        rows = self.model.rows
        return rows.n_e * (1 + self.ahead + self.history) + rows.n_a * self.history, rows.n_a

    def reset(self, robots: np.ndarray) -> None:
        """New episodes for `robots` (k,), each at rest at a random place."""
        size, rng, kinds, scales = len(robots), self.rng, self.randomised, self.scales
        self.task.begin(self.goals, robots, rng)
        stiffness = 1.0 + kinds.stiffness * rng.uniform(-1, 1, size)
        viscosity = 1.0 + kinds.viscosity * rng.uniform(-1, 1, size)
        u = scales.low + rng.uniform(0.05, 0.7, (size, len(scales.low))) * (scales.reach - scales.low)
        self.states.put(robots, self.robots.standing(u, stiffness, viscosity))
        self.u[robots], self.t[robots] = u, 0
        self.delay[robots] = rng.integers(0, kinds.delay + 1, size)
        self.commands[robots] = u[:, None]
        self.samples[robots] = self._sample(robots)[:, None]

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rewards (B,), errors (B,) mm, the mask of robots that have left what the model knows, and of those whose
        episode is over, after actions (B, n_a)."""
        self.u = self.scales.command(self.u, actions)
        self.robots.move(self.states, self.u)
        self.t += 1
        gone = ~(self.states.outside <= LEFT) | ~np.isfinite(self.states.tip).all(axis=1)
        if gone.any():  # what they are does not matter: they begin again
            self.states.tip[gone] = 0.0
        self.commands = np.concatenate([self.u[:, None], self.commands[:, :-1]], axis=1)
        self.samples = np.concatenate([self._sample(slice(None))[:, None], self.samples[:, :-1]], axis=1)
        errors = self.task.errors(self.states, self.goals, self.t)
        return np.where(gone, GONE, self.scales.reward(errors)), errors, gone, self.t >= self.length

    def observe(self) -> np.ndarray:
        """Observations (B, n) float32."""
        count, kept, n_e = self.samples.shape
        rows = self.delay[:, None] + np.arange(self.history) + kept * np.arange(count)[:, None]
        tips = self.samples.reshape(-1, n_e).take(rows, axis=0)
        return moving_observation(self.scales, tips, self.commands, ahead_of(self.goals, self.t, self.ahead))

    def _sample(self, robots: np.ndarray | slice) -> np.ndarray:
        tip = self.states.tip[robots]
        return tip + self.randomised.noise * self.rng.standard_normal(tip.shape)
