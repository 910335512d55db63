"""The example that trains a policy for `cfem/Lift-v0`, on a stand-in with its numbers."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.gym.policy import Policy, PolicyNetwork

torch, gymnasium = pytest.importorskip("torch"), pytest.importorskip("gymnasium")
pytest.importorskip("stable_baselines3")

EXAMPLE = Path(__file__).parents[2] / "examples" / "train_lift.py"
FACTS = {"format": 3, "task": "lift", "actuators": ["height", "left.a", "left.b", "right.a", "right.b"]}


class Numbers(gymnasium.Env):
    """As many numbers as two fingers with two cables on a carriage have."""

    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (29,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (5,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.ticks = 0
        return self.np_random.normal(size=29).astype(np.float32), {}

    def step(self, action):
        self.ticks += 1
        seen = self.np_random.normal(size=29).astype(np.float32)
        return seen, -float(action @ action), False, self.ticks == 4, {}


@pytest.fixture(scope="module")
def example():
    pytest.importorskip("mujoco")
    return runpy.run_path(str(EXAMPLE))


def test_a_mirrored_world_mirrored_again_is_the_world(example):
    seen, action = np.arange(1.0, 30.0), np.arange(5.0)
    for axis in (0, 1):
        order, signs, of_action = example["mirror"](axis)
        once = seen[order] * signs
        assert (once[order] * signs == seen).all() and (action[of_action][of_action] == action).all()
        assert once[axis] == -seen[axis] and once[12] == seen[12]


def test_a_mirrored_world_has_the_forces_of_the_other_finger(example):
    """The left finger pushes along y with 3, the right one against it with 2; tips are at -20 and 30 along y."""
    seen = np.zeros(29)
    seen[[18, 21, 24, 27]] = 3, -20, -2, 30
    order, signs, of_action = example["mirror"](1)
    assert (seen[order] * signs)[[18, 21, 24, 27]].tolist() == [2, -30, -3, 20]
    pulls = np.array([0.1, 1.0, 2.0, 3.0, 4.0])  # left cables at -x, +x; those of the right finger are turned: +x, -x
    assert pulls[of_action].tolist() == [0.1, 4.0, 3.0, 2.0, 1.0]
    assert pulls[example["mirror"](0)[2]].tolist() == [0.1, 2.0, 1.0, 4.0, 3.0]


def test_a_policy_of_a_few_ticks_acts_in_its_file_as_in_training(example, tmp_path):
    from stable_baselines3.common.vec_env import DummyVecEnv

    from cfem.gym.save_policy import save_network

    learner = example["learner_of"](DummyVecEnv([Numbers, Numbers]), width=8)
    learner.learn(16)
    assert learner.replay_buffer.size() == 4 * 16 // 2  # each tick of both, four times
    actor, path = example["Actor"](learner.policy.actor), tmp_path / "lift.onnx"
    save_network(actor, path, 29, FACTS)
    seen = np.random.default_rng(0).normal(size=(7, 29)).astype(np.float32)
    network = PolicyNetwork(path)
    assert network.facts == FACTS and network.inputs == 29
    assert network.actions(seen) == pytest.approx(learner.predict(seen, deterministic=True)[0], abs=1e-6)
    with pytest.raises(InputError, match="is no policy of cfem"):
        Policy(path)
