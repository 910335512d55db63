"""A policy that reaches goals, trained on a learned robot by PPO (Stable-Baselines3), as a file for `cfem control`.

    pip install 'cfem[policies]'
    python examples/train_policy.py models/soft-finger/spectral models/soft-finger/reach.onnx

Prints the error on the learned robot while it trains, and what it cost."""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO

from cfem.gym.environments import RobotVectorEnv
from cfem.gym.save_policy import save_policy
from cfem.gym.stable_baselines import RobotVecEnv


class Mean(torch.nn.Module):
    """What the policy would do without trying other things."""

    def __init__(self, policy):
        super().__init__()
        self.body, self.last = policy.mlp_extractor.policy_net, policy.action_net

    def forward(self, observation):
        return self.last(self.body(observation))


def errors(model: PPO, given: argparse.Namespace) -> np.ndarray:
    """mm at the end of 1024 episodes with seeds that training has not seen."""
    longer = None if given.task == "follow" else 1000
    env = RobotVectorEnv(given.model, 1024, given.task, randomise=given.randomise, length=longer)
    seen, _ = env.reset(seed=10**6)
    found = []
    for _ in range(60):
        seen, _, _, _, info = env.step(model.predict(seen, deterministic=True)[0])
        found.append(info["error"])
    return np.mean(found[50:], axis=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, help="folder of a spectral model")
    parser.add_argument("out", type=Path, help="file of the policy, .onnx")
    parser.add_argument("--task", default="reach", choices=["reach", "follow", "press"])
    parser.add_argument("--steps", type=int, default=600_000)
    parser.add_argument("--robots", type=int, default=256, help="in a batch")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--randomise", type=json.loads, default={}, help="keys of cfem.gym.world.Randomised, JSON")
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    env = RobotVecEnv(RobotVectorEnv(given.model, given.robots, given.task, randomise=given.randomise))
    cpu, wall = time.process_time(), time.perf_counter()
    model = PPO(
        "MlpPolicy",
        env,
        n_steps=32,
        batch_size=4 * given.robots,
        n_epochs=6,
        gamma=0.9,
        gae_lambda=0.9,
        learning_rate=lambda left: 1.5e-3 * left + 1e-5,
        policy_kwargs={"net_arch": [64, 64], "log_std_init": -1.0},
        seed=given.seed,
        device="cpu",
    )
    for part in range(6):
        model.learn(given.steps // 6, reset_num_timesteps=part == 0)
        off = errors(model, given)
        spent = f"{time.process_time() - cpu:.1f} s of CPU, {time.perf_counter() - wall:.1f} s"
        off = f"error mean {off.mean():.3f}, 95 % below {np.quantile(off, 0.95):.3f} mm"
        print(f"{model.num_timesteps} steps, {spent}: {off}", flush=True)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    save_policy(Mean(model.policy).cpu(), given.out, env.env.world)
    print(given.out)


if __name__ == "__main__":
    main()
