"""Steps of the environments a second, on one core, by CPU time; and of a batched torch loop of the paper's network.

python benchmarks/gym.py MODEL [--moving MODEL] [--robots 4096] [--steps 100] [--no-torch]

MODEL: folder of a spectral model; --moving: of one that moves. The environment does all of a step: actions, equilibrium
with slack cables or motion, reward, observation, new episodes. Random actions; of a quarter of the step for robots that
move, as full ones would throw them out of what their model knows. Of five parts of the steps the fastest counts. What a
moving robot's steps in time leave out is told by steps of a sixteenth, under the same commands.

The loop does what a plain simulator of the paper's network needs and no more: commands, the network (3 hidden layers of
450, ReLU, 32 bits, random weights, which cost what trained ones do), W and delta_free, forces by a solve, the effector:
no gradients (torch.no_grad), as the network gives W itself. Commands go where random actions lead, cables may push. The
best of batches of 256, 1024 and 4096 counts; one robot at a time is told beside it. The network's flops say how near
it is to what the core can do."""

import argparse
import time
from itertools import pairwise
from pathlib import Path

import numpy as np

from cfem.gym.environments import RobotEnv, RobotVectorEnv
from cfem.gym.moving_robots import MovingRobots
from cfem.gym.moving_tasks import MOVING
from cfem.gym.moving_world import LEFT
from cfem.gym.tasks import TASKS
from cfem.motion.load import load_motion
from cfem.predict.load import load_model


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--moving", type=Path, help="folder of a model that moves")
    parser.add_argument("--robots", type=int, default=4096)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--no-torch", action="store_true")
    given = parser.parse_args()
    model, rates = load_model(given.model), {}
    for task in TASKS:
        rates[task] = environment(model, task, given)
        print(f"{task}: {rates[task] / 1e6:.2f} million steps a second in a batch of {given.robots}", flush=True)
    if given.moving is not None:
        moving = load_motion(given.moving)
        for task in MOVING:
            rate = environment(moving, task, given, 0.25)
            print(f"{task}: {rate / 1e6:.2f} million steps a second in a batch of {given.robots}", flush=True)
        print(left_out(moving))
    print(f"reach, one robot alone: {alone(model):.0f} steps a second")
    if not given.no_torch:
        loop = max(network(model, count, given.steps) for count in (256, 1024, 4096))
        alone_too, work = network(model, 1, given.steps), 2e-9 * sum(a * b for a, b in pairwise(sizes_of(model)))
        print(
            f"the paper's network in torch, batched: {loop / 1e3:.1f} thousand steps a second, {loop * work:.0f} "
            "Gflop/s; "
            f"reach is {rates['reach'] / loop:.0f} times as fast; one robot at a time: {alone_too:.0f} steps a second"
        )


def environment(model, task: str, given: argparse.Namespace, share: float = 1.0) -> float:
    env = RobotVectorEnv(model, given.robots, task)
    env.reset(seed=0)
    shape = (20, given.robots, model.rows.n_a)
    actions = share * np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)
    env.step(actions[0])
    times = []
    for step in range(given.steps):
        begin = time.thread_time()
        env.step(actions[step % len(actions)])
        times.append(time.thread_time() - begin)
    return given.robots * fastest(times)


def fastest(times: list[float], parts: int = 5) -> float:
    """Steps a second."""
    return max(len(part) / part.sum() for part in np.array_split(times, parts))


def left_out(model, ticks: int = 100, count: int = 256) -> str:
    """Of robots under commands that change at random, by up to 5 % of the largest force a tick."""
    rng, one = np.random.default_rng(0), np.ones(count)
    coarse, fine = MovingRobots(model), MovingRobots(model, substeps=16)
    top = coarse.static.largest_force
    u = rng.uniform(0.2, 0.4, (count, len(top)))
    moved, wanted = (robots.standing(u * top, one, one) for robots in (coarse, fine))
    off, travel, known = [], [], np.ones(count, bool)
    for _ in range(ticks):
        u = np.clip(u + rng.uniform(-0.05, 0.05, u.shape), 0.1, 0.5)
        coarse.move(moved, u * top)
        fine.move(wanted, u * top)
        known &= (moved.outside < LEFT) & (wanted.outside < LEFT)
        off.append(np.linalg.norm(moved.tip - wanted.tip, axis=1))
        travel.append(wanted.tip)
    off, size = np.array(off)[:, known], np.ptp(np.array(travel)[:, known], axis=0).max()
    return (
        f"one step of 10 ms a tick against sixteen: tips differ by {off.mean():.3f} mm in the mean, {off.max():.2f} mm "
        f"at most, of {size:.0f} mm of travel; {count - known.sum()} of {count} robots left what the model knows"
    )


def alone(model, steps: int = 2000) -> float:
    env = RobotEnv(model)
    env.reset(seed=0)
    action = np.zeros(model.rows.n_a, np.float32)
    env.step(action)
    begin = time.thread_time()
    for _ in range(steps):
        env.step(action)
    return steps / (time.thread_time() - begin)


def sizes_of(model) -> list[int]:
    """Of the network's layers. Inputs: delta_a, W0, delta_free0; outputs: W, delta_free."""
    n = model.rows.n
    packed = n * (n + 1) // 2
    return [model.rows.n_a + packed + n, 450, 450, 450, packed + n]


def network(model, count: int, steps: int) -> float:
    import torch

    torch.set_num_threads(1)
    n, n_e, n_a = model.rows.n, model.rows.n_e, model.rows.n_a
    packed = n * (n + 1) // 2
    sizes = sizes_of(model)
    layers = [part for k in range(4) for part in (torch.nn.Linear(sizes[k], sizes[k + 1]), torch.nn.ReLU())][:-1]
    net = torch.nn.Sequential(*layers)
    rows, columns = torch.triu_indices(n, n)
    u, first = torch.zeros(count, n_a), torch.randn(count, packed + n)
    W, stiff = torch.zeros(count, n, n), 10 * torch.eye(n_a)
    steps = max(2, min(steps, 40 * 4096 // count // 4))
    times = []
    with torch.no_grad():
        for _ in range(steps + 1):
            begin = time.thread_time()
            u = (u + torch.rand(count, n_a) * 2 - 1).clamp(0, 20)
            out = net(torch.cat([u, first], dim=1))
            W[:, rows, columns] = out[:, :packed]
            W[:, columns, rows] = out[:, :packed]
            free = out[:, packed:]
            lam = torch.linalg.solve(W[:, n_e:, n_e:] + stiff, u - free[:, n_e:])
            tip = (W[:, :n_e, n_e:] @ lam[..., None])[..., 0] + free[:, :n_e]
            times.append(time.thread_time() - begin)
    assert tip.shape == (count, n_e)
    return count * fastest(times[1:])


if __name__ == "__main__":
    main()
