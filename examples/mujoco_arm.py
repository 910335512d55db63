"""An arm of six joints with a hand of three learned soft fingers stacks a cube, a box and a cylinder, in MuJoCo.

    pip install 'cfem[all,mujoco]'
    pip install --no-deps dm_control              # the arm: Kinova's Jaco, with its masses and joint limits
    python examples/mujoco_arm.py [--gif arm.gif]

The first run trains the finger (`cfem run pipelines/soft-finger --until train`, some minutes). Prints where each object
has come to, how fast the joints turned, what energy contact has passed on, and the time of a step. A GIF needs a
machine on which MuJoCo can render (`MUJOCO_GL=egl` without a screen)."""

import argparse
import time
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np

import cfem
from cfem.mujoco import SoftRobot, World

TABLE = """
<mujoco>
  <option timestep="0.004" integrator="implicitfast"/>
  <visual><global offwidth="640" offheight="480"/><headlight ambient="0.3 0.3 0.3"/></visual>
  <worldbody>
    <light pos="0.6 -0.6 1.2" dir="-0.2 0.5 -0.9"/>
    <camera name="side" pos="1.15 -0.4 0.45" xyaxes="0.5 0.87 0 -0.35 0.2 0.91"/>
    <geom name="table" type="plane" size="0.8 0.8 0.01" rgba="0.8 0.8 0.8 1"/>
    <body name="cube" pos="0.48 -0.15 0.017">
      <freejoint/><geom name="cube" type="box" size="0.017 0.017 0.017" mass="0.05" rgba="0.2 0.5 0.8 1"/>
    </body>
    <body name="box" pos="0.48 0.15 0.012">
      <freejoint/><geom name="box" type="box" size="0.022 0.016 0.012" mass="0.04" rgba="0.3 0.7 0.3 1"/>
    </body>
    <body name="cylinder" pos="0.57 0.03 0.015">
      <freejoint/><geom name="cylinder" type="cylinder" size="0.016 0.015" mass="0.03" rgba="0.9 0.8 0.2 1"/>
    </body>
    <frame name="base"/>
  </worldbody>
</mujoco>
"""
OBJECTS = ("cube", "box", "cylinder")  # from the lowest of the stack to the highest
STACK = np.array([0.45, 0.0])  # m
FINGERS = {"thumb": (0.0, -46.0, 0.0), "first": (-19.0, 46.0, 180.0), "second": (19.0, 46.0, 180.0)}  # mm, mm, degrees
PALM = 0.03  # m from the last joint to the fingers
TIPS = 0.127  # m from the fingers' ends in the hand to what they stand on
CLOSED = {"thumb": 7.2, "first": 5.2, "second": 5.2}  # mm of both cables
CLEAR = 0.05  # m above what is passed
SHORTEST = 0.6  # s of a move
SPEEDS = np.radians([36.0, 36.0, 36.0, 48.0, 48.0, 48.0])  # 1/s: Kinova's data sheet, as dm_control states it
DROP = 0.0005  # m above what an object is put on
TORQUES = [30.5, 30.5, 30.5, 6.8, 6.8, 6.8]  # N m
ELBOW_UP = np.array([-0.17, 2.07, 4.79, 3.02, 0.5, -0.3])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/soft-finger/spectral"), help="folder of the finger")
    parser.add_argument("--scene", type=Path, default=Path("pipelines/soft-finger/scene.yaml"))
    parser.add_argument("--patches", type=float, help="mm: touch at patches instead of at every node")
    parser.add_argument("--gif", type=Path, help="file of a moving picture")
    given = parser.parse_args()
    model = arm_with_hand()
    if not given.model.exists():
        cfem.run_folder(given.scene.parent, until="train")
    finger = SoftRobot.load(given.model, given.scene, given.patches)
    stack(World(model, dict.fromkeys(FINGERS, finger), friction=0.8), given.gif)


def arm_with_hand() -> mujoco.MjSpec:
    """The table, the objects and the arm, its gravity balanced, with servos at its joints and a hand."""
    package = find_spec("dm_control")
    if package is None:
        raise SystemExit("the model of the arm is not installed: pip install --no-deps dm_control")
    folder = Path(package.submodule_search_locations[0]) / "third_party" / "kinova"
    spec = mujoco.MjSpec.from_string(TABLE)
    arm = mujoco.MjSpec.from_file(str(folder / "jaco_arm.xml"))
    for body in arm.bodies[1:]:
        body.gravcomp = 1.0
    for geom in arm.geoms:
        geom.contype = geom.conaffinity = 0
    spec.attach(arm, frame="base", prefix="arm/")
    for number, torque in enumerate(TORQUES, 1):
        servo = spec.add_actuator(target=f"arm/joint_{number}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=3000.0, kv=200.0)
        servo.forcelimited, servo.forcerange = True, [-torque, torque]
    hand = spec.body("arm/b_6").add_body(name="hand", gravcomp=1.0)
    palm = [0.04, 0.055, 0.008]
    still = {"contype": 0, "conaffinity": 0, "rgba": [0.2, 0.2, 0.2, 1.0]}
    hand.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=palm, pos=[0, 0, 0.008 - PALM], mass=0.3, **still)
    hand.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.03, 0.012, 0], mass=0.1, **still)
    for name, (x, y, angle) in FINGERS.items():
        turn = [np.cos(np.radians(angle) / 2), 0, 0, np.sin(np.radians(angle) / 2)]
        hand.add_site(name=name, pos=[x / 1e3, y / 1e3, -PALM], quat=turn)
    return spec


class Arm:
    """Joint angles that bring the hand to a place, upright: Newton's method with damping, from the last ones."""

    def __init__(self, model: mujoco.MjModel):
        self.model, self.data, self.q = model, mujoco.MjData(model), ELBOW_UP.copy()
        self.columns = [model.joint(f"arm/joint_{number}").dofadr[0] for number in range(1, 7)]
        self.places = [model.joint(f"arm/joint_{number}").qposadr[0] for number in range(1, 7)]
        self.hand = model.body("hand").id

    def reach(self, place: np.ndarray) -> np.ndarray:
        """(6,) rad for the fingers' ends in the hand at a place (3,) m."""
        J = np.zeros((6, self.model.nv))
        for _ in range(50):
            self.data.qpos[self.places] = self.q
            mujoco.mj_kinematics(self.model, self.data)
            mujoco.mj_comPos(self.model, self.data)
            R = self.data.xmat[self.hand].reshape(3, 3)
            turn = np.array([R[1, 2] - R[2, 1], R[2, 0] - R[0, 2], R[0, 1] - R[1, 0]]) / 2
            off = np.concatenate([place + [0, 0, PALM] - self.data.xpos[self.hand], turn])
            if np.abs(off).max() < 1e-9:
                return self.q
            mujoco.mj_jacBody(self.model, self.data, J[:3], J[3:], self.hand)
            A = J[:, self.columns]
            self.q = self.q + np.clip(A.T @ np.linalg.solve(A @ A.T + 1e-6 * np.eye(6), off), -0.2, 0.2)
        raise SystemExit(f"the arm does not reach {np.round(place, 3)} m")

    def seconds(self, place: np.ndarray) -> float:
        """How long the joints take to a place, with a smooth start and end, at 90 % of the speed that they may have."""
        here = self.q
        turns, self.q = np.abs(self.reach(place) - here), here
        return max(SHORTEST, 15 / 8 * float((turns / SPEEDS).max()) / 0.9)


class Stacking:
    """The hand's motion, and what is known of it.

    place: (3,) m, where the fingers' ends in the hand are told to be; closed: how far they are, a share"""

    def __init__(self, world: World, renders: bool):
        """The hand begins above the stack."""
        self.world, self.arm = world, Arm(world.model)
        self.place, self.closed = np.array([*STACK, 0.25]), 0.0
        world.data.qpos[self.arm.places] = world.data.ctrl[:] = self.arm.reach(self.place)
        mujoco.mj_forward(world.model, world.data)
        self.renderer = mujoco.Renderer(world.model, 480, 640) if renders else None
        self.frames, self.steps, self.spent, self.fastest = [], 0, 0.0, 0.0

    def put(self, name: str, height: float) -> None:
        """Picks an object, and puts it on a stack of a height, m."""
        thing, up = self.world.data.body(name).xpos, np.array([0.0, 0.0, 1.0])
        grasp, above = np.array([*thing[:2], TIPS]), (height + CLEAR) * up
        self.go(grasp + above, 0.0)
        self.go(grasp, 0.0)
        self.go(grasp, 1.0)
        self.go(grasp + above, 1.0)
        held = [f"{np.linalg.norm(self.world.force(finger, name)):.2f}" for finger in FINGERS]
        print(f"{self.world.data.time:6.2f} s  the fingers hold the {name} with {', '.join(held)} N", flush=True)
        release = np.array([*STACK, height + half_height(self.world.model, name) + DROP]) + self.place - thing
        self.go(release + CLEAR * up, 1.0)
        self.go(release, 1.0)
        self.go(release, 0.0)
        self.go(release + CLEAR * up, 0.0)

    def go(self, place: np.ndarray, closed: float) -> None:
        """Goes to a place, m, and closes to a share, with a smooth start and end."""
        begin, world = time.process_time(), self.world
        steps = round(self.arm.seconds(place) / world.model.opt.timestep)
        for share in np.arange(1, steps + 1) / steps:
            share = share**3 * (10 - 15 * share + 6 * share**2)
            world.data.ctrl[:] = self.arm.reach(self.place + share * (place - self.place))
            pull = self.closed + share * (closed - self.closed)
            world.step({finger: np.full(2, pull * most) for finger, most in CLOSED.items()})
            speed = np.abs(world.data.qvel[self.arm.columns])
            self.fastest = max(self.fastest, float((speed / SPEEDS).max()))
            self._look()
        self.place, self.closed = place, closed
        self.spent += time.process_time() - begin

    def _look(self) -> None:
        self.steps += 1
        if self.renderer is not None and self.steps % 20 == 0:
            self.world.draw()
            self.renderer.update_scene(self.world.data, "side")
            self.frames.append(self.renderer.render())


def half_height(model: mujoco.MjModel, name: str) -> float:
    size = model.geom(name).size
    return float(size[1] if model.geom(name).type == mujoco.mjtGeom.mjGEOM_CYLINDER else size[2])


def stack(world: World, gif: Path | None = None, objects: tuple[str, ...] = OBJECTS) -> None:
    """Stacks the objects, and prints figures."""
    stacking, height, goals = Stacking(world, gif is not None), 0.0, {}
    for name in objects:
        half = half_height(world.model, name)
        goals[name] = np.array([*STACK, height + half])
        stacking.put(name, height)
        height += 2 * half
    stacking.go(stacking.place, 0.0)
    for name, goal in goals.items():
        body = world.data.body(name)
        x, y, z = 1e3 * (body.xpos - goal)
        tilt, speed = np.degrees(np.arccos(min(1.0, body.xmat[8]))), 1e3 * np.linalg.norm(body.cvel[3:])
        off = f"{x:+.1f} {y:+.1f} {z:+.1f} mm off its place, tilted by {tilt:.1f} degrees"
        print(f"the {name} is {off}, at {speed:.2g} mm/s")
    energies = world.energies
    print(
        f"contact: the commands have given {energies.commanded:.3g} N mm, {energies.passed:.3g} went to rigid bodies, "
        f"{energies.stored:.3g} are in the fingers, {energies.lost:.3g} were lost"
    )
    print(
        f"{stacking.steps} steps of {1e3 * stacking.spent / stacking.steps:.1f} ms of CPU time; "
        f"the joints reached {100 * stacking.fastest:.0f} % of the speed that Kinova allows"
    )
    if gif is not None:
        from PIL import Image

        pictures = [Image.fromarray(frame) for frame in stacking.frames]
        pictures[0].save(gif, save_all=True, append_images=pictures[1:], duration=80, loop=0)
        print(f"wrote {gif}")


if __name__ == "__main__":
    main()
