"""Policies by PPO of Stable-Baselines3, with settings for robots at rest in each tick, and for robots that move."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from cfem.gym.environments import RobotVectorEnv
from cfem.gym.moving_world import MovingWorld
from cfem.gym.stable_baselines import RobotVecEnv
from cfem.gym.world import World

PARTS = 6  # of a training, after each of which one may look


class Mean(torch.nn.Module):
    """A policy's mean action, without trying others."""

    def __init__(self, policy: Any):
        super().__init__()
        self.body, self.last = policy.mlp_extractor.policy_net, policy.action_net

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return self.last(self.body(observation))


def train(
    env: RobotVectorEnv,
    steps: int,
    width: int = 64,
    seed: int = 0,
    after: Callable[[PPO], None] = lambda learner: None,
) -> Mean:
    """Policy trained in an environment. steps: of all robots of the batch together; width: of both hidden layers;
    after: is called with the learner after each of `PARTS` parts."""
    learner = PPO(
        "MlpPolicy",
        RobotVecEnv(env),
        n_steps=32,
        batch_size=4 * env.num_envs,
        n_epochs=6,
        gamma=0.95 if isinstance(env.world, MovingWorld) else 0.9,
        gae_lambda=0.9,
        learning_rate=lambda share_left: (
            1.5e-3 * max(share_left, 0.0) + 1e-5
        ),  # the last rollout may end beyond the steps
        policy_kwargs={"net_arch": [width, width], "log_std_init": -1.0},
        seed=seed,
        device="cpu",
    )
    learner.learn(steps, callback=_Parts(steps // PARTS, after))
    return Mean(learner.policy).cpu()


class _Parts(BaseCallback):
    """Calls `after` each `steps`, and at the end."""

    def __init__(self, steps: int, after: Callable[[PPO], None]):
        super().__init__()
        self._steps, self._after, self._next = steps, after, steps

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self._next:
            self._after(self.model)
            self._next = self.num_timesteps + self._steps

    def _on_training_end(self) -> None:
        self._after(self.model)

    def _on_step(self) -> bool:
        return True


def errors(policy: Mean, world: World | MovingWorld, ticks: int = 60, last: int = 10) -> np.ndarray:
    """Errors (B,) mm, mean of the `last` of `ticks` ticks of an episode of each robot of the batch, begun before. A
    robot that leaves what its model knows counts as one that stands at rest, and begins again."""
    errors_of_ticks = []
    with torch.no_grad():
        for _ in range(ticks):
            _, error, gone, _ = world.step(policy(torch.as_tensor(world.observe())).numpy())
            errors_of_ticks.append(error)
            if gone.any():
                world.reset(np.flatnonzero(gone))
    return np.mean(errors_of_ticks[-last:], axis=0)
