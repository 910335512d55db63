"""Episodes of robots that move: what is observed and rewarded, what differs from robot to robot, and how they end."""

import numpy as np
import pytest
from gym.moving import moving
from surrogate.stored import train_folder

from cfem.core.errors import InputError
from cfem.gym.moving_tasks import MOVING, moving_observation
from cfem.gym.moving_world import GONE, MovingWorld
from cfem.gym.tasks import LARGEST, Scales
from cfem.predict.load import load_model

COUNT = 20


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = train_folder(tmp_path_factory.mktemp("plain"), "{kind: spectral, max_degree: 8}", train=60)
    return moving(load_model(folder))


def begun(model, task="moving-follow", **options):
    world = MovingWorld(model, task, COUNT, **options)
    world.reset(np.arange(COUNT))
    return world


@pytest.mark.parametrize("task", list(MOVING))
@pytest.mark.parametrize("command", ["force", "displacement"])
def test_a_step_is_finite_and_ends_by_time(model, task, command):
    world, rng = begun(model, task, command=command, length=12), np.random.default_rng(0)
    for tick in range(1, 13):
        rewards, errors, left, over = world.step(0.2 * rng.uniform(-1, 1, (COUNT, 2)))
        assert np.isfinite(rewards).all() and (errors >= 0).all() and over.all() == (tick == 12)
        assert (rewards[left] == GONE).all() and (rewards[~left] > -3).all()
        seen = world.observe()
        assert seen.shape == (COUNT, world.sizes[0]) and seen.dtype == np.float32 and np.abs(seen).max() <= LARGEST


def test_an_observation_has_its_parts_where_they_are_documented():
    scales = Scales(50.0, 2.0, np.array([0.5, 0.5]), np.zeros(2), np.array([10.0, 10.0]))
    tips, us = np.array([[[1.0, 2, 3], [0, 1, 3]]]), np.array([[[4.0, 5], [4.5, 5]]])
    goals = np.array([[[2.0, 2, 3], [3, 2, 4]]])
    wanted = [0.02, 0, 0, 0.1, 0, 0, 0.1, 0, 0.1, 0.02, 0.04, 0.06, 0.1, 0.1, 0, -0.2, 0, -1, 0]
    assert moving_observation(scales, tips, us, goals)[0] == pytest.approx(wanted, abs=1e-7)


def test_samples_are_as_late_as_the_episode_says(model):
    """The newest sample that is observed is where the tip was so many ticks ago."""
    world = begun(model, randomise={"delay": 2, "noise": 0.0})
    tips, n_e = [world.states.tip.copy()], 3
    for _ in range(5):
        world.step(np.full((COUNT, 2), 0.3))
        tips.append(world.states.tip.copy())
    begin = n_e * (1 + world.ahead)  # behind the goal, twice, and how goals go on
    seen = world.observe()[:, begin : begin + n_e] * world.scales.scale
    assert set(world.delay) == {0, 1, 2}
    for b in range(COUNT):
        assert seen[b] == pytest.approx(tips[-1 - world.delay[b]][b], abs=1e-4)


def test_the_goal_that_is_observed_is_that_of_the_end_of_the_tick(model):
    world = begun(model, randomise={"delay": 0, "noise": 0.0})
    off = world.observe()[:, :3] * world.scales.scale
    goal = off + world.states.tip
    _, errors, _, _ = world.step(np.zeros((COUNT, 2)))
    assert errors == pytest.approx(np.linalg.norm(world.states.tip - goal, axis=1), abs=1e-3)


def test_robots_differ_as_randomise_says(model):
    world = begun(model, randomise={"stiffness": 0.2, "viscosity": 0.5, "delay": 3, "noise": 0.0})
    assert 0.25 < np.ptp(world.states.stiffness) <= 0.4 and 0.6 < np.ptp(world.states.viscosity) <= 1.0
    same = begun(model, randomise={"stiffness": 0.0, "viscosity": 0.0, "delay": 0, "noise": 0.0})
    assert (same.states.stiffness == 1).all() and (same.delay == 0).all()
    assert np.array_equal(same.samples[:, 0], same.states.tip)


def test_a_robot_that_leaves_what_its_model_knows_fails(model):
    world = begun(model)
    world.states.outside[:] = 0
    world.states.q[0, 3] = 1e3
    rewards, _, left, _ = world.step(np.zeros((COUNT, 2)))
    assert left[3] and rewards[3] == GONE and left.sum() < COUNT / 2


def test_bad_input_says_so(model):
    with pytest.raises(InputError, match="no task 'moving-fly'"):
        MovingWorld(model, "moving-fly", 2)
    with pytest.raises(InputError, match="at least 1"):
        MovingWorld(model, "moving-reach", 2, history=0)


@pytest.mark.parametrize("key", ["rate", "substeps", "largest", "length", "step"])
def test_numbers_that_no_robot_has_are_refused(model, key):
    with pytest.raises(InputError, match=f"^{key}: must be a number above 0"):
        MovingWorld(model, "moving-reach", 2, **{key: -1})
