"""The environments by Gymnasium's own checks, and the batch against the single one."""

import numpy as np
import pytest
from gym.moving import moving
from surrogate.stored import train_folder

gymnasium = pytest.importorskip("gymnasium")

import cfem.gym  # noqa: E402
from cfem.predict.load import load_model  # noqa: E402

cfem.gym.register()


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return load_model(train_folder(tmp_path_factory.mktemp("plain"), "{kind: spectral, max_degree: 8}", train=60))


def of(name, model):
    return moving(model) if "Moving" in name else model


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", cfem.gym.NAMES)
def test_gymnasium_finds_nothing_wrong(model, name):
    from gymnasium.utils.env_checker import check_env

    check_env(gymnasium.make(name, model=of(name, model), render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("name", cfem.gym.NAMES)
def test_a_batch_of_one_is_the_single_environment(model, name):
    model = of(name, model)
    one = gymnasium.make(name, model=model).unwrapped
    many = gymnasium.make_vec(name, 1, vectorization_mode="vector_entry_point", model=model)
    seen, _ = one.reset(seed=3)
    batch, _ = many.reset(seed=3)
    assert np.array_equal(seen, batch[0])
    rng = np.random.default_rng(0)
    for _ in range(10):
        action = rng.uniform(-1, 1, 2).astype(np.float32)
        seen, reward, _, _, info = one.step(action)
        batch, rewards, _, _, infos = many.step(action[None])
        assert np.array_equal(seen, batch[0]) and reward == rewards[0] and info["error"] == infos["error"][0]


def test_episodes_that_are_over_are_followed_by_others(model):
    many = gymnasium.make_vec("cfem/Reach-v0", 5, vectorization_mode="vector_entry_point", model=model, length=3)
    many.reset(seed=0)
    action = np.zeros((5, 2), np.float32)
    for tick in (1, 2, 3, 4):
        seen, _, over, cut, info = many.step(action)
        assert not over.any() and cut.all() == (tick == 3)
        assert ("final_obs" in info) == (tick == 3)
        if tick == 3:
            assert info["final_obs"].shape == seen.shape and (info["final_obs"] != seen).any()
            assert (many.world.t == 0).all()


def test_the_same_seed_is_the_same_episode(model):
    found = []
    for _ in range(2):
        many = gymnasium.make_vec("cfem/Follow-v0", 8, vectorization_mode="vector_entry_point", model=model)
        many.reset(seed=11)
        found.append(many.step(np.full((8, 2), 0.5, np.float32))[0])
    assert np.array_equal(*found)


@pytest.mark.parametrize("name", ["cfem/Reach-v0", next(name for name in cfem.gym.NAMES if "Moving" in name)])
def test_a_picture_shows_effector_and_goal(model, name):
    single = gymnasium.make(name, model=of(name, model), render_mode="rgb_array")
    single.reset(seed=1)
    before = single.render()
    for _ in range(5):
        single.step(np.ones(2, np.float32))
    after = single.render()
    assert before.shape == (480, 480, 3) and before.dtype == np.uint8
    red, green = ((after[..., i].astype(int) - after[..., 1 - i] > 80).sum() for i in (0, 1))
    assert red > 10 and green > 10
    assert (before != after).any()


def test_no_picture_without_a_render_mode(model):
    single = gymnasium.make("cfem/Reach-v0", model=model).unwrapped
    single.reset(seed=0)
    assert single.render() is None
