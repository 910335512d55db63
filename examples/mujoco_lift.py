"""Two learned soft fingers on a carriage lift a cube of 50 g off a table, in MuJoCo, in steps of 2 ms.

    pip install 'cfem[all,mujoco]'
    python examples/mujoco_lift.py [--gif lift.gif]

The first run trains the finger (`cfem run pipelines/soft-finger --until train`, some minutes). Prints where the cube
is, how the fingers hold it, and what energy contact has passed on. A GIF needs a machine on which MuJoCo can render."""

import argparse
import time
from pathlib import Path

import numpy as np

import cfem
from cfem.mujoco import SoftRobot, World
from cfem.mujoco.table import TABLE

CLOSED, LIFT = 4.0, 0.05  # mm of each cable, m
TIMES = [0.0, 0.6, 0.8, 1.8, 2.6]  # s: the fingers close, hold, lift, and hold again
PULLS, HEIGHTS = [0.0, CLOSED, CLOSED, CLOSED, CLOSED], [0.0, 0.0, 0.0, LIFT, LIFT]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/soft-finger/spectral"), help="folder of the finger")
    parser.add_argument("--scene", type=Path, default=Path("pipelines/soft-finger/scene.yaml"))
    parser.add_argument("--patches", type=float, help="mm: touch at patches instead of at every node")
    parser.add_argument("--gif", type=Path, help="file of a moving picture")
    given = parser.parse_args()
    if not given.model.exists():
        cfem.run_folder(given.scene.parent, until="train")
    finger = SoftRobot.load(given.model, given.scene, given.patches)
    world = World(TABLE, {"left": finger, "right": finger}, friction=0.8)
    lift(world, given.gif)


def lift(world: World, gif: Path | None = None) -> None:
    """Goes through the motion, and prints figures."""
    frames, steps, begin = [], round(TIMES[-1] / world.model.opt.timestep), time.process_time()
    renderer = None
    if gif is not None:
        import mujoco

        renderer = mujoco.Renderer(world.model, 480, 480)
    print("    time  cube, mm from its place      on the left finger, N        on the right finger, N")
    for step in range(steps):
        now = world.data.time
        world.data.ctrl[0] = np.interp(now, TIMES, HEIGHTS)
        pull = np.full(2, np.interp(now, TIMES, PULLS))
        world.step({"left": pull, "right": pull})
        if step % 100 == 99:
            place = 1e3 * (world.data.body("cube").xpos - [0.0, 0.0, 0.015])
            forces = [world.force(finger, "cube") for finger in ("left", "right")]
            print(f"{world.data.time:6.2f} s", *(f"  [{x:7.3f} {y:7.3f} {z:7.3f}]" for x, y, z in (place, *forces)))
        if renderer is not None and step % 20 == 0:
            world.draw()
            renderer.update_scene(world.data, "side")
            frames.append(renderer.render())
    spent, energies = time.process_time() - begin, world.energies
    lifted = 1e3 * (world.data.body("cube").xpos[2] - 0.015)
    speed = 1e3 * np.linalg.norm(world.data.body("cube").cvel[3:])
    print(f"the cube hangs {lifted:.1f} mm above the table, at {speed:.2g} mm/s; {1e3 * spent / steps:.1f} ms a step")
    print(
        f"contact: the commands have given {energies.commanded:.3g} N mm, {energies.passed:.3g} went to rigid bodies, "
        f"{energies.stored:.3g} are in the fingers, {energies.lost:.3g} were lost"
    )
    if gif is not None:
        from PIL import Image

        pictures = [Image.fromarray(frame) for frame in frames]
        pictures[0].save(gif, save_all=True, append_images=pictures[1:], duration=40, loop=0)
        print(f"wrote {gif}")


if __name__ == "__main__":
    main()
