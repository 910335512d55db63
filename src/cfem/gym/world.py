"""A batch of episodes: robots, goals, what differs from robot to robot, and one step of all of them."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from cfem.condensed.parameters import shares
from cfem.core.errors import InputError
from cfem.gym.robots import FIELDS, Robots
from cfem.gym.tasks import TASKS, Goals, Scales, observation
from cfem.predict.protocol import Predictor

POOL = 4096  # robots of which episodes are
K = TypeVar("K")


@dataclass(frozen=True)
class Randomised:
    """Numbers that differ from episode to episode."""

    parameters: bool = True  # whether those of the model are drawn from their ranges
    slack: float = 0.0  # mm, by which an actuator may be less than commanded, standard deviation
    gain: float = 0.0  # share by which a command may be off
    noise: float = 0.0  # mm, of each measured coordinate of the effector, new at each tick


def randomised(kind: type[K], given: K | dict[str, Any] | None) -> K:
    """Random changes of a robot, from the keys of `kind`; its defaults where none are given. InputError for a key that
    it does not have, and for a number below 0."""
    known = [field.name for field in fields(kind)]
    if not isinstance(given, kind):
        for key in given or {}:
            if key not in known:
                raise InputError(f"unknown key '{key}'", where="randomise", do=f"known are {', '.join(known)}")
        given = kind(**(given or {}))
    for key in known:
        demand_number(f"randomise.{key}", getattr(given, key))
    return given


def demand_number(name: str, value: float | None, positive: bool = False, most: float | None = None) -> None:
    """InputError where an argument that is given is no finite number from 0 to `most`, or is 0 and must be positive."""
    if value is None or (np.isfinite(value) and (value > 0 if positive else value >= 0) and value <= (most or np.inf)):
        return
    bounds = "above 0" if positive else "of 0 or more"
    if most is not None:
        bounds += f" and at most {most:g}"
    raise InputError(f"must be a number {bounds}, got {value:g}", where=name)


class World:
    """B episodes of a task."""

    def __init__(
        self,
        model: Predictor | Path | str,
        task: str,
        count: int,
        step: float = 0.05,
        randomise: Randomised | dict[str, Any] | None = None,
        length: int | None = None,
        seed: int = 0,
        designs: np.ndarray | None = None,
        observe_parameters: bool = False,
    ):
        """Batch of `count` robots at a task.

        model: a predictor or the folder of one
        step: share of the reach by which an action of 1 changes a command
        randomise: how robots differ from the model: a `Randomised` or its keys
        length: ticks of an episode, the task's unless given
        seed: of the robots and goals that there are
        designs: (m, n_p) parameters of these robots, random unless given
        observe_parameters: whether observations hold a robot's parameters"""
        if task not in TASKS:
            raise InputError(f"there is no task '{task}'", do=f"use one of {', '.join(TASKS)}")
        if not isinstance(model, Predictor):
            from cfem.predict.load import load_model

            model = load_model(Path(model))
        demand_number("step", step, positive=True, most=1.0)
        demand_number("length", length, positive=True)
        if not model.parameters and (designs is not None or observe_parameters):
            do = "sample with `parameters:` and train again"
            raise InputError("the model has no parameters: it knows one robot only", do=do)
        kind = TASKS[task]
        self.robots = Robots(model, kind.needs, kind.loaded)
        self.model, self.count, self.name = model, count, task
        self.randomised = randomised(Randomised, randomise)
        self.observes_parameters = observe_parameters
        rng = np.random.default_rng(seed)
        self.task = kind(self.robots, self._pool(rng, designs), rng)
        self.length = self.task.length if length is None else length
        low, high = np.asarray(model.reach, float).T
        self.scales = Scales(self.task.scale, self.task.near, step * (high - low), low, high)
        self.rng = np.random.default_rng(seed)
        n_e, n_a = model.rows.n_e, model.rows.n_a
        self.goals = Goals.of(self.task, count, n_e)
        self.states, self.u, self.t = self.robots.start(count), np.zeros((count, n_a)), np.zeros(count, int)
        self.p = np.tile(self.robots.reference, (count, 1))
        self.slack, self.gain = np.zeros((count, n_a)), np.ones((count, n_a))

    def _pool(self, rng: np.random.Generator, designs: np.ndarray | None) -> np.ndarray:
        """Parameters (POOL, n_p) of the robots to draw from."""
        if designs is not None:
            designed = np.asarray(designs, float)
            if designed.ndim != 2 or designed.shape[1] != len(self.model.parameters) or not len(designed):
                names = ", ".join(parameter.name for parameter in self.model.parameters)
                raise InputError(f"designs must be rows of {names}, got an array of shape {designed.shape}")
            return designed[rng.permutation(np.arange(POOL) % len(designed))]
        if self.randomised.parameters:
            return self.robots.random_parameters(rng, POOL)
        return np.tile(self.robots.reference, (POOL, 1))

    @property
    def predictor(self) -> Predictor:
        """The model of the robots at rest."""
        return self.model

    @property
    def delta_a(self) -> np.ndarray:
        """Displacements (B, n_a) mm of the actuators now."""
        return self.states.delta_a

    @property
    def sizes(self) -> tuple[int, int]:
        """Sizes of an observation and of an action."""
        rows, n_parameters = self.model.rows, len(self.model.parameters) if self.observes_parameters else 0
        return 4 * rows.n_e + rows.n_a + n_parameters, rows.n_a

    def reset(self, robots: np.ndarray) -> None:
        """New episodes for `robots` (k,), each at a random place."""
        size, rng, kinds, scales = (len(robots), self.u.shape[1]), self.rng, self.randomised, self.scales
        self.p[robots] = self.task.begin(self.goals, robots, rng)
        self.u[robots] = scales.low + rng.random(size) * (scales.reach - scales.low) * 0.6
        self.slack[robots] = kinds.slack * np.abs(rng.standard_normal(size))
        self.gain[robots] = 1.0 + kinds.gain * rng.uniform(-1, 1, size)
        self.stand(robots)

    def stand(self, robots: np.ndarray) -> None:
        """Begins the episodes of `robots` (k,) where their commands bring them from rest."""
        self.t[robots] = 0
        moved = self.robots.move(
            self.robots.start(len(robots)), self._felt(robots), self.p[robots], loads=self._load(robots)
        )
        for name in FIELDS:
            getattr(self.states, name)[robots] = getattr(moved, name)

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rewards (B,), errors (B,) mm, the mask of robots whose episode has failed (none), and of those whose is over,
        after actions (B, n_a)."""
        all_robots = slice(None)
        self.u = self.scales.command(self.u, actions)
        self.states = self.robots.move(self.states, self._felt(all_robots), self.p, loads=self._load(all_robots))
        self.t += 1
        errors = self.task.errors(self.states, self.goals, self.t)
        return self.scales.reward(errors), errors, np.zeros(self.count, bool), self.t >= self.length

    def observe(self) -> np.ndarray:
        """Observation (B, n) float32. The goal is that of the end of the tick that follows, as in a loop of `cfem
        control`."""
        tip = self.task.tip(self.states, self.goals)
        if self.randomised.noise:
            tip = tip + self.randomised.noise * self.rng.standard_normal(tip.shape)
        ahead = self.task.ahead(self.states, self.goals, self.t + 1)
        parameters = 2.0 * shares(self.model.parameters, self.p) - 1.0 if self.observes_parameters else self.p[:, :0]
        return observation(self.scales, tip, self.u, self.goals.now(self.t + 1), ahead, parameters)

    def _felt(self, robots: np.ndarray | slice) -> np.ndarray:
        felt = self.u[robots] * self.gain[robots] - self.slack[robots]
        return np.maximum(felt, self.scales.low)

    def _load(self, robots: np.ndarray | slice) -> np.ndarray | None:
        return self.goals.load[robots] if self.task.loaded else None
