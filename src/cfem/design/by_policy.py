"""Co-design by policy: the design with which one trained policy brings the effectors to the goals best.

A policy that observes its robot's parameters is one controller for all designs. So a design is judged by what the
policy does with it: episodes on learned robots, thousands of designs in a batch, begun at the same commands, one for
each goal. Best means the largest reward of the environments (`cfem.gym.tasks`), the mean over ticks and goals, which
counts how fast goals are reached; or the least distance at the end of the episodes (rms), as `cfem.design.task` has it.
Search by cross-entropy: it needs no gradient, and the episodes have none."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import qmc

from cfem.core.errors import InputError, NumericalError
from cfem.design.task import Task
from cfem.equilibrium.system.robot import Robot
from cfem.gym.policy import Policy
from cfem.gym.robots import Robots
from cfem.parametric.family import LearnedFamily, Varied
from cfem.plant.fem_plant import FemPlant

START, LAST = 0.4, 5  # share of the reach where episodes begin; ticks at the end that count as where they led
FIRST, ROUND, ROUNDS, BEST = 2048, 256, 12, 24  # designs at first, in each round, rounds, those that the next is around


@dataclass(frozen=True)
class Judged:
    """A design and how a policy fares on it."""

    p: np.ndarray  # (n_p,)
    reward: float  # mean
    distance: np.ndarray  # (k,) mm from each goal at the end


@dataclass
class ByPolicy(Varied):
    """Judgement of designs by a policy that drives them. InputError where the policy is of another robot, or the task
    asks what it does not know.

    family: learned
    task: goals, without weights or forces
    p0, free: as of `Varied`
    ticks: of an episode"""

    family: LearnedFamily
    task: Task
    policy: Policy
    p0: np.ndarray
    free: list[int]
    ticks: int = 30

    def __post_init__(self) -> None:
        """Checks that the policy is for this task. InputError where it observes no parameters, or the task has weights
        or forces."""
        where, rows = str(self.policy.path), self.family.rows
        self.policy.demand_robot(rows.effectors, rows.actuators)
        if self.policy.parameters != tuple(self.family.parameters):
            do = "train it on this model, with --observe-parameters"
            raise InputError("the policy does not observe the parameters of this model", where=where, do=do)
        if self.task.force.any() or not (self.task.weights == 1).all():
            raise InputError("a task with a policy has neither weights nor forces", where=where, do="leave them out")
        self._robots, self.steps = Robots(self.family.predictor), 0

    def judge(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rewards (m,) and distances (m, k) mm of designs p (m, n_p)."""
        k = len(self.task.goals)
        goals, p = self._goals(p).reshape(len(p) * k, -1), np.repeat(p, k, axis=0)
        observed, u = self.policy.told(p), np.tile(self._start, (len(p), 1))
        states, rewards, errors = self._robots.move(self._robots.start(len(p)), u, p), 0.0, []
        for _ in range(self.ticks):
            u = self.policy.commands(states.tip, u, goals, np.zeros_like(goals), observed)
            states = self._robots.move(states, u, p)
            errors.append(np.linalg.norm(states.tip - goals, axis=1))
            rewards = rewards + self.policy.scales.reward(errors[-1])
        self.steps += self.ticks * len(p)
        distance = np.mean(errors[-LAST:], axis=0).reshape(-1, k)
        return rewards.reshape(-1, k).mean(axis=1) / self.ticks, distance

    def at(self, p: np.ndarray) -> Judged:
        """Judgement of one design p (n_p,)."""
        reward, distance = self.judge(p[None])
        return Judged(p, float(reward[0]), distance[0])

    def best(self, candidates: np.ndarray, by: Literal["reward", "distance"]) -> Judged:
        """Best design that the search finds. candidates: (m, n_p) designs to judge as well."""
        rng, n = np.random.default_rng(0), len(self.free)
        z = np.vstack([self.z(candidates), qmc.Halton(n, seed=0).random(FIRST)])
        known, costs = z, self._costs(z, by)
        for _ in range(ROUNDS):
            top = known[np.argsort(costs)[:BEST]]
            spread = np.maximum(top.std(axis=0), 1e-3)
            z = np.clip(top.mean(axis=0) + spread * rng.standard_normal((ROUND, n)), 0.0, 1.0)
            known, costs = np.vstack([known, z]), np.concatenate([costs, self._costs(z, by)])
        return self.at(self.p(known[np.argmin(costs)]))

    def _costs(self, z: np.ndarray, by: str) -> np.ndarray:
        reward, distance = self.judge(self.p(z))
        return -reward if by == "reward" else (distance**2).sum(axis=1)

    def in_fe(self, p: np.ndarray, robot: Robot) -> Judged:
        """Judgement of one design, its finite-element robot in place of the learned one, with feedback in every
        tick."""
        goals, observed, errors = self._goals(p[None])[0], self.policy.told(p), []
        for goal in goals:
            plant, u, apart = FemPlant(robot), self._start, []
            for _ in range(self.ticks + 1):
                measured = plant.step(u)
                if not np.isfinite(measured.x_e).all():
                    raise NumericalError(f"the finite-element robot of the policy's design: {measured.status}")
                tip = measured.x_e - robot.rest_e
                apart.append(np.linalg.norm(tip - goal))
                u = self.policy.command(tip, u, goal, np.zeros_like(goal), observed)
            errors.append(apart[1:])
        errors = np.array(errors)
        return Judged(p, float(self.policy.scales.reward(errors).mean()), errors[:, -LAST:].mean(axis=1))

    @property
    def _start(self) -> np.ndarray:
        low, high = self.family.reach.T
        return low + START * (high - low)

    def _goals(self, p: np.ndarray) -> np.ndarray:
        """Goals (m, k, n_e) mm from where each design rests."""
        rest = np.zeros((len(p), 1)) if self.task.from_rest else self.family.rest(p)
        return self.task.goals - rest[:, None]
