"""A policy that lifts a cube with learned fingers in MuJoCo, graded in finite elements.

    python examples/train_lift.py models/soft-finger/spectral models/soft-finger/lift.onnx
    python benchmarks/lift.py models/soft-finger/lift.onnx [--episodes 5]

The policy runs in `cfem/Lift-v0`, in episodes that it was not trained on. Its commands then go to two fingers of finite
elements on the mesh of the samples, which touch the cube at every node of their surfaces, with the episode's friction.
On their way to the grip the cube goes, against the carriage, as in the episode. From the first tick on from which it
stays in the grip (`SETTLED`), or at the last tick, it is free there under its weight in the episode: its place and tilt
are those at which the fingers of finite elements balance the weight. Compared are, against MuJoCo with the learned
fingers, the force of each finger on the cube as a vector, the place of the cube against the carriage, and how it is
turned: at the first tick of the free cube, halfway from there to the end, and at the end. Finite elements are at rest
in each. Needs the trained finger; half a minute of CPU time an episode and more."""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.obstacle import Box
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.gym.policy import PolicyNetwork
from cfem.mujoco import SoftRobot
from cfem.mujoco.geoms import MM
from cfem.mujoco.lift import LiftEnv
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.held_body import HeldBody, Pose

SETTLED = 0.3  # mm that the cube goes in a tick against the carriage, where it stays in the grip
LONGEST = 0.8  # mm: way of a cable, or of the cube, to the next stop of the finite elements
FIRST = 10**6 + 100  # seed of the first episode


@dataclass(frozen=True, eq=False)
class Tick:
    """One tick of an episode.

    pose: of the cube in the scene, where the carriage is taken to stay at its start
    cables: (n_a,) mm of each finger
    forces: (r, 3) N of each finger on the cube
    on_table: whether the cube touches the table"""

    pose: Pose
    cables: list[np.ndarray]
    forces: np.ndarray
    on_table: bool


def seen_now(env: LiftEnv) -> Tick:
    """What there is in an environment."""
    data, model = env.world.data, env.world.model
    cube, carriage = data.body("cube"), data.body("carriage")
    down = MM * (carriage.xpos - model.body("carriage").pos)
    touching = {int(model.geom(name).id) for name in ("cube", "table")}
    on_table = any(set(contact.geom.tolist()) == touching for contact in data.contact[: data.ncon])
    forces = -np.array([env.world.force(name, "cube") for name in env.world.robots])
    cables = np.split(env.commands[model.nu :], len(env.world.robots))
    return Tick(Pose(cube.xmat.reshape(3, 3).copy(), MM * cube.xpos - down), cables, forces, on_table)


def episode(env: LiftEnv, policy: PolicyNetwork, seed: int) -> tuple[list[Tick], float, str]:
    """Ticks of an episode, the error at its end, mm, and why it failed."""
    seen, _ = env.reset(seed=seed)
    ticks, over = [seen_now(env)], False
    while not over:
        seen, _, failed, cut, info = env.step(policy.actions(seen[None])[0])
        ticks.append(seen_now(env))
        over = failed or cut
    return ticks, info["error"], info["failed"]


def first_free(ticks: Sequence[Tick], size: float) -> int:
    """Number of the first tick from which on the cube touches no table and stays in the grip; the last one where it
    never does."""
    moves = [a.pose.way(b.pose, size) > SETTLED or b.on_table for a, b in pairwise(ticks)]
    return min(1 + max((i for i, moved in enumerate(moves, 1) if moved), default=0), len(ticks) - 1)


def stops(ticks: Sequence[Tick], free: int, size: float) -> list[int]:
    """Numbers of ticks at which finite elements stop: none is farther than LONGEST, where ticks are no farther."""
    kept, compared = [0], {free, (free + len(ticks) - 1) // 2, len(ticks) - 1}
    for i, tick in enumerate(ticks[1:], 1):
        last = ticks[kept[-1]]
        pulled = max(np.abs(a - b).max() for a, b in zip(tick.cables, last.cables, strict=True))
        if i in compared or max(pulled, tick.pose.way(last.pose, size)) > LONGEST:
            kept.append(i)
    return kept


def fingers(env: LiftEnv, scene: Path) -> list[SkinnedRobot]:
    """Fingers of finite elements, which touch at every node, where the environment has its own."""
    spec, mesh = load_scene_and_mesh(scene)
    robot = build_robot(spec, mesh)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    data = mujoco.MjData(env.world.model)
    mujoco.mj_kinematics(env.world.model, data)
    sites = [data.site(name) for name in env.world.robots]
    places = [(site.xmat.reshape(3, 3).copy(), MM * site.xpos) for site in sites]
    return [SkinnedRobot(robot, surface.nodes, surface.triangles, points, R, t, itself=False) for R, t in places]


def graded(env: LiftEnv, ticks: Sequence[Tick], robots: Sequence[SkinnedRobot]) -> list[tuple[int, np.ndarray]]:
    """Numbers of ticks, and figures (3,) there: the largest difference of a finger's force over that force, and by how
    much the cube is elsewhere, mm, and turned, degrees."""
    half = MM * env.world.model.geom("cube").size
    size, mu = float(half.max()), env.world.friction
    body = HeldBody(robots, Box(half), ticks[0].pose, size, mu)
    weight = float(env.world.model.body("cube").mass[0]) * env.world.model.opt.gravity
    load, free, figures = np.concatenate([weight, np.zeros(3)]), first_free(ticks, size), []
    if ticks[-1].on_table:
        return []
    for i in stops(ticks, free, size)[1:]:
        tick = ticks[i]
        if i < free:
            body.go(tick.pose, tick.cables)
            continue
        if i == free:
            body.go(tick.pose, tick.cables)
        state = body.balance(load, tick.cables)
        off = np.linalg.norm(state.forces - tick.forces, axis=1) / np.linalg.norm(tick.forces, axis=1)
        turned = Rotation.from_matrix(state.pose.R @ tick.pose.R.T).magnitude()
        place = np.linalg.norm(state.pose.t - tick.pose.t)
        figures.append((i, np.array([off.max(), place, np.degrees(turned)])))
    halfway = (free + len(ticks) - 1) // 2
    return [(i, figure) for i, figure in figures if i in {free, halfway, len(ticks) - 1}]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", type=Path)
    parser.add_argument("--model", type=Path, default=Path("models/soft-finger/spectral"))
    parser.add_argument("--scene", type=Path, default=Path("pipelines/soft-finger/scene.yaml"))
    parser.add_argument("--episodes", type=int, default=5)
    given = parser.parse_args()
    env, policy = LiftEnv(SoftRobot.load(given.model, given.scene)), PolicyNetwork(given.policy)
    robots, begin = fingers(env, given.scene), time.process_time()
    print("| episode | error in MuJoCo (mm) | tick | force off (%) | place off (mm) | turned (degrees) |")
    print("|---|---|---|---|---|---|")
    for number in range(given.episodes):
        ticks, error, failed = episode(env, policy, FIRST + number)
        try:
            rows = [] if failed else graded(env, ticks, robots)
            why = failed or "the cube does not stay in the grip"
        except RuntimeError as no_state:
            rows, why = [], str(no_state)
        for i, (force, place, turned) in rows:
            print(f"| {number} | {error:.2f} | {i} | {100 * force:.2g} | {place:.3f} | {turned:.3f} |", flush=True)
        if not rows:
            print(f"| {number} | {error:.2f} | {why} | | | |", flush=True)
    print(f"{time.process_time() - begin:.0f} s of CPU time")


if __name__ == "__main__":
    main()
