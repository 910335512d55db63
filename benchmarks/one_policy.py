"""One policy for a whole family of designs, against a specialist for each of designs that it has not seen.

python benchmarks/one_policy.py MODEL SCENE MESH [--designs 50] [--steps 200000] [--times 1] [--goals 1] [--ticks 3]

MODEL: folder of a spectral model with parameters; SCENE, MESH: of its robot. Trains by PPO, with the same settings and,
with --times 1, the same steps: one policy that is told the parameters of its robot, one that is not, and for each of
the designs a specialist on it alone. The designs are random, with a seed of their own. Errors are means of the last
ticks of an episode: on the learned robot over 64 goals of that design; in the finite-element robot to --goals of them,
in --ticks ticks with feedback from where the episode on the learned robot ended."""

import argparse
import time
from pathlib import Path

import numpy as np
import torch

from cfem.control.task.design import robot_at
from cfem.equilibrium.system.robot import Robot
from cfem.gym.environments import RobotVectorEnv
from cfem.gym.tasks import observation
from cfem.gym.train import Mean, errors, train
from cfem.gym.world import World
from cfem.plant.fem_plant import FemPlant
from cfem.predict.load import load_model
from cfem.robot.load import load_scene_and_mesh


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("scene", type=Path)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--designs", type=int, default=50)
    parser.add_argument("--steps", type=int, default=200_000)
    parser.add_argument("--times", type=int, default=1, help="steps of the one policy, over those of a specialist")
    parser.add_argument("--goals", type=int, default=1)
    parser.add_argument("--ticks", type=int, default=3)
    given = parser.parse_args()
    torch.set_num_threads(1)
    model, begin = load_model(given.model), time.process_time()
    told = train(RobotVectorEnv(model, 256, "reach", observe_parameters=True), given.times * given.steps)
    print(f"one policy, told the design: {time.process_time() - begin:.0f} s of CPU", flush=True)
    untold, found = train(RobotVectorEnv(model, 256, "reach"), given.times * given.steps), []
    scene_and_mesh = load_scene_and_mesh(given.scene, given.mesh)
    unseen = World(model, "reach", 1).robots.random_parameters(np.random.default_rng(77), given.designs)
    for number, p in enumerate(unseen):
        begin = time.process_time()
        specialist = train(RobotVectorEnv(model, 256, "reach", designs=p[None]), given.steps, seed=number)
        spent = time.process_time() - begin
        worlds = [begun(model, p, one is told) for one in (told, untold, specialist)]
        row = [errors(*pair, 40).mean() for pair in zip((told, untold, specialist), worlds, strict=True)]
        robot = robot_at(*scene_and_mesh, model.parameters, p)[0]
        row += [in_fe(told, worlds[0], robot, given), in_fe(specialist, worlds[2], robot, given)]
        found.append(row)
        numbers = ", ".join(f"{one:.4f}" for one in row)
        print(f"design {number + 1}, specialist {spent:.0f} s of CPU: {numbers} mm", flush=True)
    titles = {"learned robot": (0, 2), "learned robot, not told": (1, 2), "finite elements": (3, 4)}
    for title, columns in titles.items():
        compared(title, *np.array(found)[:, columns].T)


def compared(title: str, one: np.ndarray, other: np.ndarray) -> None:
    print(f"{title}: one policy mean {one.mean():.4f}, largest {one.max():.4f} mm; specialists {other.mean():.4f}, "
          f"{other.max():.4f} mm; ratio of means {one.mean() / other.mean():.2f}, median ratio "
          f"{np.median(one / other):.2f}, within 2 times on {(one <= 2 * other).sum()} of {len(one)}")  # fmt: skip


def begun(model, p: np.ndarray, told: bool) -> World:
    """64 episodes on the design p, the same for every policy."""
    world = World(model, "reach", 64, designs=p[None], observe_parameters=told, seed=5)
    world.reset(np.arange(64))
    return world


def in_fe(policy: Mean, world: World, robot: Robot, given: argparse.Namespace) -> float:
    """mm in the finite-element robot, mean of the last two ticks, at the first goals of a world after its episodes."""
    scales, off = world.scales, []
    told = world.observe()[:1, 4 * world.model.rows.n_e + world.model.rows.n_a :]
    for k in range(given.goals):
        plant, goal, u = FemPlant(robot), world.goals.path[k, 0], world.u[k]
        tip = plant.step(u).x_e - robot.rest_e
        for _ in range(given.ticks):
            seen = observation(scales, tip[None], u[None], goal[None], np.zeros_like(goal)[None], told)
            with torch.no_grad():
                action = policy(torch.as_tensor(seen)).numpy()[0].astype(float)
            u = np.clip(u + np.clip(action, -1, 1) * scales.step, scales.low, scales.reach)
            tip = plant.step(u).x_e - robot.rest_e
            off.append(np.linalg.norm(tip - goal))
    return float(np.mean(np.reshape(off, (given.goals, -1))[:, -2:]))


if __name__ == "__main__":
    main()
