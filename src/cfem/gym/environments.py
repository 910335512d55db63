"""Gymnasium environments of learned robots, one at a time and many at once."""

from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from cfem.gym.moving_tasks import MOVING
from cfem.gym.moving_world import MovingWorld
from cfem.gym.tasks import LARGEST, Press
from cfem.gym.world import World
from cfem.motion.model import MotionModel
from cfem.predict.protocol import Predictor


def world_of(model: Any, task: str, count: int, **options: Any) -> World | MovingWorld:
    """The batch behind an environment. Arguments as `RobotEnv`."""
    return (MovingWorld if task in MOVING else World)(model, task, count, **options)


def _spaces(world: World | MovingWorld) -> tuple[gymnasium.spaces.Box, gymnasium.spaces.Box]:
    seen, acts = world.sizes
    return (
        gymnasium.spaces.Box(-LARGEST, LARGEST, (seen,), np.float32),
        gymnasium.spaces.Box(-1.0, 1.0, (acts,), np.float32),
    )


class RobotEnv(gymnasium.Env):
    """Environment of one robot."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 10}

    def __init__(
        self,
        model: Predictor | MotionModel | Path | str,
        task: str = "reach",
        render_mode: str | None = None,
        **options: Any,
    ):
        """World of one robot. model: folder of a spectral model, or the model; render_mode: 'rgb_array' or None;
        options: of `World`, or of `MovingWorld`."""
        self.render_mode = render_mode
        self.world = world_of(model, task, 1, **options)
        self.observation_space, self.action_space = _spaces(self.world)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self.world.rng = self.np_random
        self.world.reset(np.zeros(1, int))
        return self.world.observe()[0], self._info(None)

    def step(self, action: np.ndarray):
        rewards, errors, failed, over = self.world.step(np.asarray(action)[None])
        info = self._info(float(errors[0]))
        return self.world.observe()[0], float(rewards[0]), bool(failed[0]), bool(over[0]), info

    def render(self) -> np.ndarray | None:
        """Picture (480, 480, 3) uint8 of surface, effector (red) and goal (green) of the robot, None without
        `render_mode`."""
        if self.render_mode != "rgb_array":
            return None
        from cfem.gym.picture import picture

        world, model = self.world, self.world.predictor
        tip, goal = world.states.tip[0], world.goals.now(world.t)[0]
        return picture(model, world.delta_a[0], model.rest_e + tip, model.rest_e + goal)

    def _info(self, error: float | None) -> dict[str, Any]:
        """Facts beside the observation."""
        info = {"tip": self.world.states.tip[0].copy(), "command": self.world.u[0].copy()}
        if error is not None:
            info["error"] = error
        if isinstance(self.world.task, Press):
            info["force"] = float(self.world.task.force(self.world.states, self.world.goals)[0])
        if self.world.name == "carry":
            info["load"] = self.world.goals.load[0].copy()
        return info


class RobotVectorEnv(VectorEnv):
    """Many robots in one batch. An episode that is over is followed by a new one in the same step (SAME_STEP), its last
    observation in info['final_obs']. Arguments as `RobotEnv`."""

    metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(
        self,
        model: Predictor | MotionModel | Path | str,
        num_envs: int = 1,
        task: str = "reach",
        render_mode: str | None = None,
        **options: Any,
    ):
        """World of `num_envs` robots in a batch; the other arguments: as of the environment of one robot."""
        self.render_mode, self.num_envs = render_mode, num_envs
        self.world = world_of(model, task, num_envs, **options)
        self.single_observation_space, self.single_action_space = _spaces(self.world)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self.world.rng = self.np_random
        self.world.reset(np.arange(self.num_envs))
        return self.world.observe(), {}

    def step(self, actions: np.ndarray):
        """Observations, rewards, failures, ends and facts after a tick; robots whose episode ended begin again."""
        rewards, errors, failed, over = self.world.step(actions)
        info: dict[str, Any] = {"error": errors, "_error": np.ones(self.num_envs, bool)}
        observations = self.world.observe()
        ended = failed | over
        if ended.any():
            info["final_obs"], info["_final_obs"] = observations.copy(), ended
            self.world.reset(np.flatnonzero(ended))
            observations = self.world.observe()
        return observations, rewards, failed, over, info
