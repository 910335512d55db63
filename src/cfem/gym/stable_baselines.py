"""The environments as Stable-Baselines3 has them: a batch of robots behind its `VecEnv`."""

from typing import Any

import numpy as np
from stable_baselines3.common.vec_env import VecEnv

from cfem.gym.environments import RobotVectorEnv


class RobotVecEnv(VecEnv):
    """A batch as Stable Baselines takes it. Where an episode ends by time, the infos say so, so that values are
    bootstrapped."""

    def __init__(self, env: RobotVectorEnv):
        self.env = env
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self._returns, self._lengths, self._actions = np.zeros(env.num_envs), np.zeros(env.num_envs, int), None

    def reset(self) -> np.ndarray:
        self._returns[:], self._lengths[:] = 0.0, 0
        return self.env.reset(seed=self._seeds[0])[0]

    def step_async(self, actions: np.ndarray) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Observations, rewards, ends and facts of the last actions, as Stable Baselines has them."""
        observations, rewards, failed, late, info = self.env.step(self._actions)
        over = failed | late
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._returns += rewards
        self._lengths += 1
        for i in np.flatnonzero(over):
            episode = {"r": float(self._returns[i]), "l": int(self._lengths[i]), "t": 0.0}
            infos[i] = {
                "terminal_observation": info["final_obs"][i],
                "TimeLimit.truncated": not failed[i],
                "episode": episode,
                "error": float(info["error"][i]),
            }
        self._returns[over], self._lengths[over] = 0.0, 0
        return observations, rewards.astype(np.float32), over, infos

    def close(self) -> None:
        self.env.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        return [getattr(self.env, attr_name, None)] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        return [getattr(self.env, method_name)(*args, **kwargs)] * self.num_envs

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        return [False] * self.num_envs
