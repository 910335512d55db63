"""A Gymnasium environment on a `World`: soft robots grip an object and bring it to where it shall be.

    cfem.gym.register()
    env = gymnasium.make("cfem/Lift-v0", model="models/soft-finger/spectral", scene="pipelines/soft-finger/scene.yaml")

What is there, a MuJoCo model says: its actuators and those of the robots are the action."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

from cfem.core.errors import InputError, NumericalError
from cfem.mujoco.geoms import MM, name_of
from cfem.mujoco.soft_robot import SoftRobot
from cfem.mujoco.table import QUICK_TABLE
from cfem.mujoco.world import World
from cfem.predict.contact.step.state import TRUSTED

FORMAT = 3  # of a policy's file
LARGEST = 10.0  # number in an observation
FAILED = -10.0  # reward where a world cannot go on, or the object is lost
LOST = 3.0  # of the way: farther from its goal the object is lost
BEYOND = 2.0  # of the error that contact is trusted to: an episode ends
UNEVEN = 0.2  # reward that commands cost where those of a robot are as far from their mean as they may
NEAR = 0.1  # of the way: an error that is small, and observed more finely


class LiftEnv(gymnasium.Env):
    """Soft robots on the bodies of a MuJoCo model, whose object is to go from its place in the model by `way`.

    model, scene: of `SoftRobot.load`; or model: a `SoftRobot`
    mjcf: of `World`; a table, a cube, and two fingers on a carriage, unless given
    robots: names of the sites that have one each
    thing: name of the object's body, which has a free joint, and of its geom
    way: (3,) mm
    closed: share of the reach to which the robots' actuators go; apart: share of that range by which an actuator may
        be away from the mean of those of its robot
    step: share of its range by which an action of 1 changes a command in a tick
    tick: s, a multiple of the timestep; length: ticks of an episode
    aside: mm, by which the object begins beside its place, at most, along x and y
    mass: least and largest share of the object's mass in the model; friction: least and largest coefficient of the
        robots' surfaces. Each episode has its own
    patches: of `SoftRobot.load`

    commands (n,): of MuJoCo's actuators, then of the robots', in their units; low, high (n,): their range
    ticks: of this episode so far"""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 12.5}

    def __init__(
        self,
        model: SoftRobot | Path | str,
        scene: Path | str | None = None,
        mjcf: Path | str | mujoco.MjSpec = QUICK_TABLE,
        robots: tuple[str, ...] = ("left", "right"),
        thing: str = "cube",
        way: tuple[float, float, float] = (0.0, 0.0, 50.0),
        closed: float = 0.25,
        apart: float = 0.12,
        step: float = 0.12,
        tick: float = 0.08,
        length: int = 30,
        aside: float = 4.0,
        mass: tuple[float, float] = (0.6, 1.4),
        friction: tuple[float, float] = (0.7, 1.0),
        patches: float | None = None,
        render_mode: str | None = None,
    ):
        """A world of robots that are alike; arguments as above, render_mode: 'rgb_array' or None."""
        if not isinstance(model, SoftRobot):
            if scene is None:
                raise InputError("a model that is loaded needs its scene", do="state `scene`, its scene.yaml")
            model = SoftRobot.load(model, scene, patches)
        self.world, self.render_mode = World(mjcf, dict.fromkeys(robots, model), friction[1]), render_mode
        self.thing, self.length, self.aside, self.share = thing, length, aside, step
        self.mass, self.friction, self.apart = mass, friction, apart
        self._place = _place_of(self.world.model, thing)
        self._steps = max(1, round(tick / self.world.model.opt.timestep))
        self._goal_way, self._size = np.asarray(way, float), float(np.linalg.norm(way))
        mj, reach = self.world.model, np.asarray(model.surface.model.reach, float)
        limited = mj.actuator_ctrllimited.astype(bool)
        if not limited.all():
            raise InputError("an actuator of the MuJoCo model has no range", do="state its ctrlrange")
        low, high = mj.actuator_ctrlrange.T
        self.low = np.concatenate([low, *[reach[:, 0]] * len(robots)])
        self.high = np.concatenate([high, *[reach[:, 0] + closed * np.ptp(reach, axis=1)] * len(robots)])
        self._start = np.concatenate([np.clip(0.0, low, high), np.zeros(len(robots) * len(reach))])
        self._body = mj.body(thing).id
        self._inertia = mj.body_mass[self._body].copy(), mj.body_inertia[self._body].copy()
        self._weight = max(float(self._inertia[0] * np.linalg.norm(mj.opt.gravity)), 1e-9)
        self._renderer: mujoco.Renderer | None = None
        self.reset(seed=0)
        self.observation_space = gymnasium.spaces.Box(-LARGEST, LARGEST, self._observe().shape, np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, self.low.shape, np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Observation and info after the object is put beside its place at random, all commands at their start."""
        super().reset(seed=seed)
        world = self.world
        aside = self.np_random.uniform(-self.aside, self.aside, 2)
        self._make(self.np_random.uniform(*self.mass), self.np_random.uniform(*self.friction))
        world.reset()
        self._goal = MM * world.data.body(self.thing).xpos + self._goal_way
        world.data.qpos[self._place : self._place + 2] += aside / MM
        world.data.ctrl[:] = self._start[: world.model.nu]
        mujoco.mj_forward(world.model, world.data)
        self.commands, self.ticks = self._start.copy(), 0
        return self._observe(), self._info()

    def _make(self, share: float, friction: float) -> None:
        """An object of this share of its mass, and robots of this coefficient of friction."""
        world, model = self.world, self.world.model
        model.body_mass[self._body], model.body_inertia[self._body] = (share * each for each in self._inertia)
        mujoco.mj_setConst(model, world.data)
        world.friction = friction

    def step(self, action: np.ndarray):
        """Observation, reward, ended, truncated and info of one tick; action (n,) in [-1, 1], changes of commands."""
        move = np.clip(np.nan_to_num(np.asarray(action, float)), -1.0, 1.0) * self.share
        before, failed = self.commands, ""
        self.commands = self._bounded(before + move * (self.high - self.low))
        self.ticks += 1
        try:
            for share in np.arange(1, self._steps + 1) / self._steps:
                self._go(before + share * (self.commands - before))
        except NumericalError as error:
            failed = str(error)
        distance = float(np.linalg.norm(self._to_goal()))
        if not failed and distance > LOST * self._size:
            failed = f"the {self.thing} is lost"
        reward = FAILED if failed else self._reward(distance)
        return self._observe(), reward, bool(failed), self.ticks >= self.length, self._info() | {"failed": failed}

    def render(self) -> np.ndarray | None:
        """Picture (480, 480, 3) uint8 by MuJoCo, of its first camera; None without `render_mode`."""
        if self.render_mode != "rgb_array":
            return None
        if self._renderer is None:
            self._renderer = mujoco.Renderer(self.world.model, 480, 480)
        self.world.draw()
        self._renderer.update_scene(self.world.data, 0 if self.world.model.ncam else -1)
        return self._renderer.render().copy()

    def close(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def facts(self) -> dict[str, Any]:
        """Facts beside a policy's network, as plain data: what its observations and actions are of."""
        names = [name_of(self.world.model, mujoco.mjtObj.mjOBJ_ACTUATOR, i) for i in range(self.world.model.nu)]
        for name, robot in self.world.robots.items():
            names += [f"{name}.{actuator}" for actuator in robot.surface.model.rows.actuators]
        numbers = {"low": self.low.tolist(), "high": self.high.tolist(), "step": self.share, "apart": self.apart}
        return {"format": FORMAT, "task": "lift", "command": "displacement", "actuators": names} | numbers

    def _bounded(self, commands: np.ndarray) -> np.ndarray:
        """Commands (n,) within their ranges, those of each robot near their mean."""
        shares = np.clip((commands - self.low) / (self.high - self.low), 0.0, 1.0)
        for robot in np.split(shares, self._cuts)[1:]:
            robot[:] = np.clip(robot, robot.mean() - self.apart, robot.mean() + self.apart)
        return self.low + shares * (self.high - self.low)

    def _go(self, commands: np.ndarray) -> None:
        """One timestep of the world."""
        by_mujoco, *by_robot = np.split(commands, self._cuts)
        self.world.data.ctrl[:] = by_mujoco
        error = self.world.step(dict(zip(self.world.robots, by_robot, strict=True))).error
        if error > BEYOND * TRUSTED:
            raise NumericalError(f"forces bend a robot so far that what they do is {error:.0%} off", do="press less")

    @property
    def _cuts(self) -> np.ndarray:
        """Numbers at which the commands of each robot begin."""
        each = [robot.surface.model.rows.n_a for robot in self.world.robots.values()]
        return self.world.model.nu + np.cumsum([0, *each[:-1]])

    def _to_goal(self) -> np.ndarray:
        """(3,) mm from the object to its goal."""
        return self._goal - MM * self.world.data.body(self.thing).xpos

    def _reward(self, distance: float) -> float:
        """Reward of an error, mm: see docs/mujoco.md."""
        beyond = min(max(self.world.contact.error / TRUSTED - 1, 0.0), 1.0)
        near, held = np.exp(-distance / (NEAR * self._size)), 0.2 * self.held()
        return float(1 + near - distance / self._size + held - beyond - UNEVEN * self._uneven())

    def _uneven(self) -> float:
        """Mean square of how far commands of robots are from the mean of their robot, over the farthest."""
        robots = np.split((self.commands - self.low) / (self.high - self.low), self._cuts)[1:]
        return float(np.mean([((robot - robot.mean()) / self.apart) ** 2 for robot in robots]))

    def held(self) -> float:
        """Share of the robots that press the object with its weight, less of those that press less."""
        forces = [np.linalg.norm(self.world.force(name, self.thing)) for name in self.world.robots]
        return float(np.minimum(np.array(forces) / self._weight, 1.0).mean())

    def _observe(self) -> np.ndarray:
        """Observation (n,) float32 of numbers of about 1: see docs/mujoco.md."""
        data, model = self.world.data, self.world.model
        body = data.body(self.thing)
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, body.id, velocity, 0)
        share = 2.0 * (self.commands - self.low) / (self.high - self.low) - 1.0
        to_goal = self._to_goal() / self._size
        parts = [to_goal, np.clip(to_goal / NEAR, -1, 1), MM * velocity[3:] / (5 * self._size)]
        parts += [body.xmat.reshape(3, 3)[2], share]
        for name, robot in self.world.robots.items():
            parts.append(self.world.force(name, self.thing) / self._weight)
            for point in robot.points:
                parts.append(MM * (data.sensor(f"{name}.{point}").data - body.xpos) / self._size)
        return np.clip(np.concatenate(parts), -LARGEST, LARGEST).astype(np.float32)

    def _info(self) -> Mapping[str, Any]:
        """Facts beside the observation: the error, mm, and the commands, in their units."""
        return {"error": float(np.linalg.norm(self._to_goal())), "command": self.commands.copy()}


def _place_of(model: mujoco.MjModel, thing: str) -> int:
    """Number in qpos of a free body's place. InputError where there is no such body, with a geom of its name."""
    body, geom = (
        mujoco.mj_name2id(model, kind, thing) for kind in (mujoco.mjtObj.mjOBJ_BODY, mujoco.mjtObj.mjOBJ_GEOM)
    )
    if body < 0 or geom < 0:
        raise InputError(f"the MuJoCo model has no body and geom '{thing}'", do="name both so, or state `thing`")
    first = model.body_jntadr[body]
    if first < 0 or model.jnt_type[first] != mujoco.mjtJoint.mjJNT_FREE:
        raise InputError(f"the body '{thing}' has no free joint", do="give it one: <freejoint/>")
    return int(model.jnt_qposadr[first])
