"""Steps of the environments a second, on one core, by CPU time; and of a batched torch loop of the paper's network.

python benchmarks/gym.py MODEL [--robots 4096] [--steps 100] [--no-torch]

MODEL: folder of a spectral model. The environment does all of a step: actions, equilibrium with slack cables, reward,
observation, new episodes. The loop does what a plain simulator of the network needs and no more: commands, the network
(3 hidden layers of 450, random weights, which cost what trained ones do), W and delta_free, forces by a solve, the
effector. Commands go where random actions lead. The best of several batches counts for the loop."""

import argparse
import time
from pathlib import Path

import numpy as np

from cfem.gym.environments import RobotEnv, RobotVectorEnv
from cfem.gym.tasks import TASKS
from cfem.predict.load import load_model


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path)
    parser.add_argument("--robots", type=int, default=4096)
    parser.add_argument("--steps", type=int, default=100)
    parser.add_argument("--no-torch", action="store_true")
    given = parser.parse_args()
    model, rates = load_model(given.model), {}
    for task in TASKS:
        rates[task] = environment(model, task, given)
        print(f"{task}: {rates[task] / 1e6:.2f} million steps a second in a batch of {given.robots}", flush=True)
    print(f"reach, one robot alone: {alone(model):.0f} steps a second")
    if not given.no_torch:
        loop = max(network(model, count, given.steps) for count in (256, 1024, 4096))
        print(f"the paper's network in torch, batched: {loop / 1e3:.1f} thousand steps a second; "
              f"reach is {rates['reach'] / loop:.0f} times as fast")  # fmt: skip


def environment(model, task: str, given: argparse.Namespace) -> float:
    env = RobotVectorEnv(model, given.robots, task)
    env.reset(seed=0)
    shape = (20, given.robots, model.rows.n_a)
    actions = np.random.default_rng(0).uniform(-1, 1, shape).astype(np.float32)
    env.step(actions[0])
    begin = time.thread_time()
    for step in range(given.steps):
        env.step(actions[step % len(actions)])
    return given.steps * given.robots / (time.thread_time() - begin)


def alone(model, steps: int = 2000) -> float:
    env = RobotEnv(model)
    env.reset(seed=0)
    action = np.zeros(model.rows.n_a, np.float32)
    env.step(action)
    begin = time.thread_time()
    for _ in range(steps):
        env.step(action)
    return steps / (time.thread_time() - begin)


def network(model, count: int, steps: int) -> float:
    import torch

    torch.set_num_threads(1)
    n, n_e, n_a = model.rows.n, model.rows.n_e, model.rows.n_a
    packed = n * (n + 1) // 2
    sizes = [n_a + packed + n, 450, 450, 450, packed + n]  # inputs: delta_a, W0, delta_free0
    layers = [part for k in range(4) for part in (torch.nn.Linear(sizes[k], sizes[k + 1]), torch.nn.ReLU())][:-1]
    net = torch.nn.Sequential(*layers)
    rows, columns = torch.triu_indices(n, n)
    u, first = torch.zeros(count, n_a), torch.randn(count, packed + n)
    W, stiff = torch.zeros(count, n, n), 10 * torch.eye(n_a)
    steps = max(2, min(steps, 40 * 4096 // count // 4))
    with torch.no_grad():
        for step in range(steps + 1):
            if step == 1:
                begin = time.thread_time()
            u = (u + torch.rand(count, n_a) * 2 - 1).clamp(0, 20)
            out = net(torch.cat([u, first], dim=1))
            W[:, rows, columns] = out[:, :packed]
            W[:, columns, rows] = out[:, :packed]
            free = out[:, packed:]
            lam = torch.linalg.solve(W[:, n_e:, n_e:] + stiff, u - free[:, n_e:])
            tip = (W[:, :n_e, n_e:] @ lam[..., None])[..., 0] + free[:, :n_e]
    assert tip.shape == (count, n_e)
    return steps * count / (time.thread_time() - begin)


if __name__ == "__main__":
    main()
