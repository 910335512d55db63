"""A policy that lifts a cube with two soft fingers, trained in MuJoCo by SAC (Stable-Baselines3) in two processes.

    pip install 'cfem[all,mujoco,policies]'
    python examples/train_lift.py models/soft-finger/spectral models/soft-finger/lift.onnx

The environment is `cfem/Lift-v0` as it is: the cube begins up to 4 mm aside in both directions, its mass differs by
40 %, friction is 0.7 to 1. Learning begins with episodes of commands that are written by hand, with targets and noise
drawn at random. What is learned is looked at a few times in 20 episodes that it does not learn from, and the best
policy of these looks is kept. At the end it is compared with commands that are written by hand, in 20 other episodes.
Prints error, success and cost. Success: the cube ends less than 2 mm from the goal, both fingers press it with the
weight of the model's cube. Needs a trained finger: `cfem run pipelines/soft-finger --until train`."""

import argparse
import time
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3 import SAC
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import SubprocVecEnv, VecEnv

from cfem.gym.save_policy import save_network
from cfem.mujoco import SoftRobot
from cfem.mujoco.lift import LiftEnv
from cfem.mujoco.table import TABLE

PROCESSES, LOOKS = 2, 5
LOOKED_AT, UNSEEN = range(10**5, 10**5 + 20), range(10**6, 10**6 + 20)  # seeds
WITHIN, HELD = 2.0, 0.99  # mm, share
BY_HAND = np.array([0.048, 4.0, 4.0, 4.0, 4.0])  # m of the carriage, mm of the cables
FINE = TABLE.replace('timestep="0.002"', 'timestep="0.005"')
LIFTS = 9  # ticks: from there on the carriage rises
NOISE = 0.3  # of actions by hand
Act = Callable[[np.ndarray], np.ndarray]


class Actor(torch.nn.Module):
    """Mean action of a policy by SAC, without trying others."""

    def __init__(self, actor: torch.nn.Module):
        super().__init__()
        self.body, self.last = actor.latent_pi, actor.mu

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return torch.tanh(self.last(self.body(observation)))


def mirror(axis: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Order (29,) and signs (29,) of an observation, and order (5,) of an action, of the mirrored world: along x (0)
    the cables of each finger change places, along y (1) the fingers too."""
    flip = np.where(np.arange(3) == axis, -1.0, 1.0)
    order, signs = np.arange(29), np.ones(29)
    signs[:12] = np.tile(flip, 4)  # way to the goal, coarse and fine, velocity, row of the rotation matrix
    signs[17:] = np.tile(flip, 4)  # force and tip of each finger
    action = np.array([0, 2, 1, 4, 3] if axis == 0 else [0, 4, 3, 2, 1])
    order[12:17] = 12 + action
    if axis == 1:
        order[17:] = np.roll(order[17:], 6)
    return order, signs, action


class Mirrored(ReplayBuffer):
    """Keeps each tick four times: as it was, mirrored along x, along y, and along both."""

    def add(self, obs, next_obs, action, reward, done, infos) -> None:
        x, y = mirror(0), mirror(1)
        for flips in ((), (x,), (y,), (x, y)):
            seen, after, act = obs, next_obs, action
            for order, signs, of_action in flips:
                seen, after, act = seen[:, order] * signs, after[:, order] * signs, act[:, of_action]
            super().add(seen, after, act, reward, done, infos)


def by_hand(env: LiftEnv, target: np.ndarray) -> np.ndarray:
    """Action towards a target (5,) of the commands; the carriage stays down until the fingers have closed."""
    wanted = np.where((np.arange(5) == 0) & (env.ticks < LIFTS), env.low, target)
    return np.clip((wanted - env.commands) / (env.high - env.low) / env.share, -1, 1)


class Worker(LiftEnv):
    """The environment in a process of its own, with what learning asks of it beside steps."""

    def __init__(self, model: Path, scene: Path, part: slice):
        """part: of the episodes to be judged by."""
        robot = SoftRobot.load(model, scene)
        super().__init__(robot)
        self._judged, self._fine, self._part = LiftEnv(robot), LiftEnv(robot, mjcf=FINE), part

    def begin(self, seed: int) -> None:
        """Draws targets of an episode by hand."""
        self._rng = rng = np.random.default_rng(seed)
        pulls = rng.uniform(3.0, 4.5) + np.repeat(rng.uniform(-0.5, 0.5) * np.array([1, -1]), 2)
        self._target = np.array([rng.uniform(0.04, 0.06), *(pulls + rng.uniform(-0.5, 0.5) * np.array([1, -1, -1, 1]))])

    def shown(self) -> np.ndarray:
        """The next action (5,) by hand, with noise."""
        action = by_hand(self, self._target) + self._rng.normal(0.0, NOISE, 5)
        return np.clip(action, -1, 1).astype(np.float32)

    def spent(self) -> float:
        """s of CPU time of this process."""
        return time.process_time()

    def judged(
        self, policy: torch.nn.Module | None, seeds: range, fine: bool = False
    ) -> list[tuple[float, float, bool, float]]:
        """Results of its part of these episodes, of a policy, or of commands by hand; fine: in steps of 5 ms."""
        torch.set_num_threads(1)
        env = self._fine if fine else self._judged

        def act(seen: np.ndarray) -> np.ndarray:
            if policy is None:
                return by_hand(env, BY_HAND)
            with torch.no_grad():
                return policy(torch.as_tensor(seen[None]))[0].numpy()

        return [episode(env, act, seed) for seed in seeds[self._part]]


def show(learner: SAC, envs: VecEnv, episodes: int) -> None:
    """Fills the buffer with episodes by hand, in each process."""
    count, number = envs.num_envs, 0
    seen, ended = envs.reset(), np.ones(count, dtype=bool)
    while True:
        for i in np.flatnonzero(ended):
            envs.env_method("begin", number, indices=int(i))
            number += 1
        if number >= episodes + count:
            return
        action = np.array(envs.env_method("shown"))
        after, rewards, ended, infos = envs.step(action)
        true_after = after.copy()
        for i in np.flatnonzero(ended):
            true_after[i] = infos[i]["terminal_observation"]
        learner.replay_buffer.add(seen, true_after, action, rewards, ended, infos)
        seen = after


def learner_of(envs: VecEnv, seed: int = 0, width: int = 128) -> SAC:
    return SAC(
        "MlpPolicy",
        envs,
        learning_rate=lambda left: 2e-4 + 8e-4 * left,
        gamma=0.95,
        tau=0.01,
        batch_size=256,
        learning_starts=0,
        train_freq=1,
        gradient_steps=6,
        ent_coef="auto_0.1",
        buffer_size=400_000,
        replay_buffer_class=Mirrored,
        policy_kwargs={"net_arch": [width, width]},
        seed=seed,
        device="cpu",
    )


def episode(env: LiftEnv, act: Act, seed: int) -> tuple[float, float, bool, float]:
    """Error (mm) at the end, share of the weight that the fingers press with, whether it failed, and the sum of
    rewards."""
    seen, _ = env.reset(seed=seed)
    total, ended = 0.0, False
    while not ended:
        seen, reward, failed, cut, info = env.step(act(seen))
        total, ended = total + reward, failed or cut
    return info["error"], env.held(), bool(failed), total


class Looks(BaseCallback):
    """Looks a few times at how the policy does, and keeps the best.

    best: that policy"""

    def __init__(self, envs: VecEnv, steps: int, wall: float):
        super().__init__()
        self._envs, self._part, self._next, self._wall = envs, steps // LOOKS, steps // LOOKS, wall
        self.best, self._rank = None, (-1, 0.0)

    def look(self, who: str, policy: torch.nn.Module | None, seeds: range, fine: bool = False) -> tuple[int, float]:
        """Prints how a policy does, or commands by hand. Returns successes and the mean reward of an episode."""
        results = [result for part in self._envs.env_method("judged", policy, seeds, fine) for result in part]
        errors, held, failed, rewards = (np.array(column) for column in zip(*results, strict=True))
        good = (errors < WITHIN) & (held > HELD) & ~failed
        cpu = time.process_time() + sum(self._envs.env_method("spent"))
        print(
            f"{who}: success {good.sum()} of {len(good)}, error median {np.median(errors):.2f}, largest "
            f"{errors.max():.2f} mm, reward {rewards.mean():.1f}; {cpu:.0f} s of CPU, "
            f"{time.perf_counter() - self._wall:.0f} s",
            flush=True,
        )
        return int(good.sum()), float(rewards.mean())

    def _on_step(self) -> bool:
        if self.num_timesteps >= self._next:
            self._next += self._part
            policy = Actor(self.model.policy.actor)
            rank = self.look(f"{self.num_timesteps} ticks", policy, LOOKED_AT)
            if rank > self._rank:
                self.best, self._rank = deepcopy(policy), rank
        return True


def trained(model: Path, scene: Path, steps: int, shown: int, seed: int) -> tuple[Actor, dict[str, Any]]:
    """A policy, and the facts that its file has beside it."""
    wall = time.perf_counter()
    makers = [partial(Worker, model, scene, slice(i, None, PROCESSES)) for i in range(PROCESSES)]
    envs = SubprocVecEnv(makers, start_method="spawn")
    try:
        learner, looks = learner_of(envs, seed), Looks(envs, steps, wall)
        show(learner, envs, shown)
        learner.learn(steps, callback=looks)
        looks.look("unseen, by hand", None, UNSEEN)
        looks.look("unseen, the policy", looks.best, UNSEEN)
        looks.look("unseen, by hand, steps of 5 ms", None, UNSEEN, True)
        looks.look("unseen, the policy, steps of 5 ms", looks.best, UNSEEN, True)
        return looks.best, envs.env_method("facts", indices=0)[0]
    finally:
        envs.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, help="folder of the finger's spectral model")
    parser.add_argument("out", type=Path, help="file of the policy, .onnx")
    parser.add_argument("--scene", type=Path, default=Path("pipelines/soft-finger/scene.yaml"))
    parser.add_argument("--steps", type=int, default=5000, help="ticks of both processes together")
    parser.add_argument("--shown", type=int, default=40, help="episodes by hand")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    torch.set_num_threads(1)
    policy, facts = trained(given.model, given.scene, given.steps, given.shown, given.seed)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    save_network(policy, given.out, len(mirror(0)[0]), facts)
    print(given.out)


if __name__ == "__main__":
    main()
