"""Time of a step of `cfem.mujoco`: three fingers close on a cube, lift it and hold it, dt 2 ms.

    python benchmarks/mujoco_hand.py [--patches 6] [--model DIR --scene FILE]

CPU time of each part of the run: the least, the median and the mean of its steps. Where other programs share the
machine, the least is the one to compare. The first run asks finite elements how the finger's surface yields
(minutes)."""

import argparse
import gc
import time
from pathlib import Path

import numpy as np

from cfem.mujoco import SoftRobot, World

HAND = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast"/>
  <worldbody>
    <geom name="table" type="plane" size="0.3 0.3 0.01"/>
    <body name="carriage" pos="0 0 0.127">
      <joint name="height" type="slide" axis="0 0 1"/>
      <geom type="box" pos="0 0 0.01" size="0.02 0.07 0.008" mass="0.5" contype="0" conaffinity="0"/>
      <site name="thumb" pos="0 -0.046 0"/>
      <site name="first" pos="-0.019 0.046 0" euler="0 0 180"/>
      <site name="second" pos="0.019 0.046 0" euler="0 0 180"/>
    </body>
    <body name="cube" pos="0 0 0.017">
      <freejoint/><geom name="cube" type="box" size="0.017 0.017 0.017" mass="0.05"/>
    </body>
  </worldbody>
  <actuator><position name="height" joint="height" kp="2000" kv="60" ctrlrange="0 0.08"/></actuator>
</mujoco>
"""
CLOSED = {"thumb": 7.2, "first": 5.2, "second": 5.2}  # mm of both cables
CLOSING, LIFTING, UP = 0.6, (0.7, 1.2), 0.05  # s, s, m
PARTS = {"nothing touches": (5, 80), "closing": (120, 300), "lifting": (350, 600), "holding": (620, 700)}  # steps


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/soft-finger/spectral"))
    parser.add_argument("--scene", type=Path, default=Path("pipelines/soft-finger/scene.yaml"))
    parser.add_argument("--patches", type=float, help="mm: touch at patches instead of at every node")
    given = parser.parse_args()
    finger = SoftRobot.load(given.model, given.scene, given.patches)
    world, spent, rounds = World(HAND, dict.fromkeys(CLOSED, finger), friction=0.8), [], []
    world.step({})  # compiles
    world.reset()
    gc.collect()  # of all that has been imported: else Python does so within a step
    for step in range(1, 701):
        t = 0.002 * step
        world.data.ctrl[0] = UP * np.clip((t - LIFTING[0]) / (LIFTING[1] - LIFTING[0]), 0.0, 1.0)
        begin = time.process_time()
        state = world.step({name: [min(t / CLOSING, 1.0) * mm] * 2 for name, mm in CLOSED.items()})
        spent.append(1e3 * (time.process_time() - begin))
        rounds.append(state.iterations)
    for name, (first, last) in PARTS.items():
        part = np.array(spent[first:last])
        times = f"{part.min():5.1f} ms at least, {np.median(part):5.1f} in the median, {part.mean():5.1f} on average"
        print(f"{name:16s} {times}, {np.mean(rounds[first:last]):.1f} rounds")
    height, force = 1e3 * world.data.body("cube").xpos[2], np.linalg.norm(world.force("thumb", "cube"))
    print(f"the cube is {height:.9f} mm high, held with {force:.9f} N by the thumb")


if __name__ == "__main__":
    main()
