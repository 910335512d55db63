"""Two bars that grip a block, as a Gymnasium environment."""

from dataclasses import replace
from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.predict.contact.step.state import TRUSTED, ContactState

gymnasium = pytest.importorskip("gymnasium")

import cfem.gym  # noqa: E402
from cfem.mujoco.lift import LiftEnv  # noqa: E402

cfem.gym.register()

BLOCK = """
<mujoco>
  <option timestep="0.004" integrator="implicitfast"/>
  <worldbody>
    <geom name="table" type="plane" size="0.3 0.3 0.01"/>
    <body name="carriage" pos="0 0 0.081">
      <joint name="height" type="slide" axis="0 0 1"/>
      <geom type="box" size="0.01 0.02 0.005" mass="0.2" contype="0" conaffinity="0"/>
      <site name="left" pos="0 -0.015 0" xyaxes="0 0 -1 -1 0 0"/>
      <site name="right" pos="0 0.015 0" xyaxes="0 0 -1 1 0 0"/>
    </body>
    <body name="cube" pos="0 0 0.02">
      <freejoint/><geom name="cube" type="box" size="0.012 0.008 0.02" mass="0.002"/>
    </body>
  </worldbody>
  <actuator><position name="height" joint="height" kp="500" kv="20" ctrlrange="0 0.03"/></actuator>
</mujoco>
"""


def made(soft_bar, **more):
    given = {"mjcf": BLOCK, "way": (0.0, 0.0, 10.0), "closed": 0.2, "tick": 0.008, "step": 0.1, "length": 100}
    given |= {"aside": 0.3, "mass": (1.0, 1.0), "friction": (0.3, 0.3)} | more
    return gymnasium.make("cfem/Lift-v0", model=soft_bar, **given).unwrapped


@pytest.fixture(scope="module")
def env(soft_bar):
    return made(soft_bar)


@pytest.mark.filterwarnings("error")
def test_gymnasium_finds_nothing_wrong(env):
    from gymnasium.utils.env_checker import check_env

    check_env(env, skip_render_check=True)


def test_the_same_seed_and_actions_give_the_same_digits(env):
    rng, episodes = np.random.default_rng(0), []
    actions = rng.uniform(-1, 1, (5, 3)).astype(np.float32)
    for seed in (1, 1, 2):
        seen = [env.reset(seed=seed)[0]]
        seen += [env.step(action)[0] for action in actions]
        episodes.append(np.array(seen))
    assert np.array_equal(episodes[0], episodes[1]) and not np.array_equal(episodes[0][0], episodes[2][0])


def test_bars_that_close_and_rise_bring_the_block_to_its_goal(env):
    """What is held needs one round a step: it begins with forces that go on as in the last one."""
    env.reset(seed=0)
    rewards, rounds = [], []
    for tick in range(90):
        up = np.clip((tick - 40) / 40, 0, 1) * 0.010 / 0.03
        target = np.array([up, *[min(1.0, tick / 40)] * 2]) * (env.high - env.low) + env.low
        action = (target - env.commands) / (env.high - env.low) / env.share
        seen, reward, failed, cut, info = env.step(action.astype(np.float32))
        assert not failed and not cut
        rewards.append(reward)
        rounds.append(env.world.contact.iterations)
    assert np.mean(rounds[:40]) < 3.0 and max(rounds[80:]) == 1
    assert info["error"] < 1.0 and rewards[0] < 0.0 and rewards[-1] > 1.5
    assert info["command"] == pytest.approx(env.low + np.array([1 / 3, 1, 1]) * (env.high - env.low), rel=1e-5)
    assert seen[:3] == pytest.approx([0, 0, 0], abs=0.1) and seen[12:15] == pytest.approx([-1 / 3, 1, 1], abs=1e-5)
    assert seen[3:6] == pytest.approx(np.clip(10 * seen[:3], -1, 1), abs=1e-6)


def test_the_forces_that_a_step_begins_with_change_no_answer(soft_bar, monkeypatch):
    """Of a block that slides and turns between bars that close on it."""
    ends = []
    for guess in (True, False):
        env = made(soft_bar)
        env.reset(seed=0)
        if not guess:
            monkeypatch.setattr(ContactState, "steady", False)
        for _ in range(20):
            env.step(np.array([0, 1, 1], np.float32))
        ends.append(env.world.data.body("cube").xpos.copy())
    assert ends[0] == pytest.approx(ends[1], abs=1e-9) and not np.array_equal(*ends)


def test_each_episode_has_a_mass_and_a_friction_of_its_own(soft_bar):
    """An object of twice the mass falls alike, and rests with twice the force."""
    env, seen = made(soft_bar, mass=(0.5, 2.0), friction=(0.2, 0.4)), []
    for seed in range(4):
        env.reset(seed=seed)
        seen.append((env.world.model.body("cube").mass[0], env.world.friction))
        assert env.world.model.body_subtreemass[0] == pytest.approx(0.2 + seen[-1][0])
    masses, frictions = np.array(seen).T
    assert (masses > 0.001).all() and (masses < 0.004).all() and np.ptp(masses) > 1e-4
    assert (frictions > 0.2).all() and (frictions < 0.4).all() and np.ptp(frictions) > 1e-3
    env.reset(seed=0)
    assert env.world.model.body("cube").mass[0] == masses[0]


def test_commands_of_one_robot_stay_near_each_other(env):
    """Shares of the range, of a robot with two cables."""
    two = SimpleNamespace(low=np.zeros(3), high=np.array([0.1, 5.0, 5.0]), apart=0.1, _cuts=np.array([1]))
    for wanted, given in (([0.2, 4.0, 0.0], [0.1, 2.5, 1.5]), ([0.0, 1.2, 1.4], [0.0, 1.2, 1.4])):
        assert LiftEnv._bounded(two, np.array(wanted)) == pytest.approx(given)
    alone = env.high
    assert np.array_equal(env._bounded(alone), alone) and env._uneven() == 0.0
    two.commands = np.array([0.0, 2.25, 1.75])  # half as far from their mean as they may
    assert LiftEnv._uneven(two) == pytest.approx(0.25)


def test_bending_a_robot_beyond_what_it_knows_costs_and_ends_the_episode(soft_bar, monkeypatch):
    env = made(soft_bar)
    for error, less, ends in ((0.5, 0.0, False), (1.5, 0.5, False), (2.5, 0.0, True)):
        env.reset(seed=0)
        env.step(np.zeros(3, np.float32))
        worlds_step, still = env.world.step, env._reward(10.0)

        def step(commands, error=error, worlds_step=worlds_step):
            env.world.contact = replace(worlds_step(commands), error=error * TRUSTED)
            return env.world.contact

        monkeypatch.setattr(env.world, "step", step)
        _, _, failed, _, info = env.step(np.zeros(3, np.float32))
        monkeypatch.undo()
        assert failed == ends and ("what they do is 9% off" in info["failed"]) == ends
        if not ends:
            env.world.contact = replace(env.world.contact, error=error * TRUSTED)
            assert env._reward(10.0) == pytest.approx(still - less)


def test_a_policy_is_saved_with_what_its_numbers_are_of(env):
    facts = env.facts()
    assert facts["actuators"] == ["height", "left.cable", "right.cable"] and facts["task"] == "lift"
    assert facts["high"] == env.high.tolist() and facts["step"] == env.share


def test_a_block_that_is_lost_ends_the_episode(env):
    env.reset(seed=0)
    env.world.data.qpos[1] += 0.1
    _, reward, failed, _, info = env.step(np.zeros(3, np.float32))
    assert failed and reward == -10.0 and info["failed"] == "the cube is lost"


def test_an_episode_ends_by_time(soft_bar):
    env = made(soft_bar, length=2)
    env.reset(seed=0)
    assert [env.step(np.zeros(3, np.float32))[3] for _ in range(2)] == [False, True]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("ctrlrange", "gear"), "no range"),
        (("<freejoint/>", '<joint type="slide"/>'), "no free joint"),
        (('<body name="cube"', '<body name="die"'), "no body and geom 'cube'"),
    ],
)
def test_what_no_episode_is_made_of_is_said(soft_bar, change, said):
    with pytest.raises(InputError, match=said):
        made(soft_bar, mjcf=BLOCK.replace(*change).replace('gear="0 0.03"', ""))


def test_a_model_without_its_scene_is_refused():
    with pytest.raises(InputError, match="needs its scene"):
        made("models/bar/spectral")


def test_a_picture_shows_what_is_there(soft_bar):
    env = made(soft_bar, render_mode="rgb_array")
    try:
        mujoco.Renderer(env.world.model, 16, 16).close()
    except Exception as error:  # of whichever library of OpenGL is missing
        pytest.skip(f"MuJoCo cannot render here: {error}")
    picture = env.render()
    env.close()
    assert picture.shape == (480, 480, 3) and picture.dtype == np.uint8 and np.ptp(picture) > 50
