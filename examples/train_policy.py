"""A policy trained on a learned robot by PPO (Stable-Baselines3), as a file for `cfem control`.

    pip install 'cfem[policies]'
    python examples/train_policy.py models/soft-finger/spectral models/soft-finger/reach.onnx

Prints the error on the learned robot while it trains, and what it cost."""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch

from cfem.gym import TASKS
from cfem.gym.environments import RobotVectorEnv, world_of
from cfem.gym.moving_tasks import MOVING
from cfem.gym.save_policy import save_policy
from cfem.gym.train import Mean, errors, train


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, help="folder of a spectral model; moving tasks: with dynamics")
    parser.add_argument("out", type=Path, help="file of the policy, .onnx")
    parser.add_argument("--task", default="reach", choices=TASKS)
    parser.add_argument("--steps", type=int, default=600_000)
    parser.add_argument("--robots", type=int, default=256, help="in a batch")
    parser.add_argument("--width", type=int, default=64, help="of the two hidden layers")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--randomise",
        type=json.loads,
        default={},
        help="keys of cfem.gym.world.Randomised, or of MovingRandomised, as JSON",
    )
    parser.add_argument("--observe-parameters", action="store_true", help="tell the policy the robot's parameters")
    given = parser.parse_args()
    torch.set_num_threads(given.threads)
    options = {"task": given.task, "randomise": given.randomise}
    if given.task not in MOVING:
        options["observe_parameters"] = given.observe_parameters
    env = RobotVectorEnv(given.model, given.robots, **options)
    unseen = world_of(env.world.model, count=1024, seed=10**6, **options)  # robots, goals and starts
    cpu, wall = time.process_time(), time.perf_counter()

    def tell(learner) -> None:
        unseen.reset(np.arange(unseen.count))
        off = errors(Mean(learner.policy), unseen, *((150, 90) if given.task in MOVING else (60, 10)))
        spent = f"{time.process_time() - cpu:.1f} s of CPU, {time.perf_counter() - wall:.1f} s"
        off = f"error mean {off.mean():.3f}, 95 % below {np.quantile(off, 0.95):.3f} mm"
        print(f"{learner.num_timesteps} steps, {spent}: {off}", flush=True)

    policy = train(env, given.steps, given.width, given.seed, tell)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    save_policy(policy, given.out, env.world)
    print(given.out)


if __name__ == "__main__":
    main()
