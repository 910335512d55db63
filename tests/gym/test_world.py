"""Episodes in a batch: what is observed, what is rewarded, what differs from robot to robot."""

import numpy as np
import pytest
from surrogate.stored import train_folder

from cfem.core.errors import InputError
from cfem.gym.tasks import LARGEST, TASKS, Follow
from cfem.gym.world import Randomised, World
from cfem.predict.load import load_model


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = train_folder(tmp_path_factory.mktemp("p"), "{kind: spectral, max_degree: 8}", train=80, parameters=True)
    return load_model(folder)


def begun(model, task, count=40, **options):
    world = World(model, task, count, **options)
    world.reset(np.arange(count))
    return world


@pytest.mark.parametrize("task", list(TASKS))
def test_a_step_is_finite_and_ends_by_time(model, task):
    world, rng = begun(model, task), np.random.default_rng(0)
    for tick in range(1, world.length + 1):
        rewards, errors, _, over = world.step(rng.uniform(-1, 1, (40, 2)))
        assert np.isfinite(rewards).all() and (errors >= 0).all() and over.all() == (tick == world.length)
        seen = world.observe()
        assert seen.shape == (40, world.sizes[0]) and seen.dtype == np.float32 and np.abs(seen).max() <= LARGEST


@pytest.mark.parametrize("length", [5, Follow.length + 5])
def test_an_episode_may_be_shorter_or_longer_than_its_goals(model, length):
    world = begun(model, "follow", 4, length=length)
    for tick in range(1, length + 1):
        *_, over = world.step(np.zeros((4, 2)))
        assert over.all() == (tick == length)
    assert np.isfinite(world.observe()).all()


def test_goals_can_be_reached(model):
    """Commands at which the pool of goals was solved lead there, whatever the parameters: of forces alone."""
    world = begun(model, "reach", randomise=Randomised(parameters=False))
    pool = world.task._pool
    world.goals.path[:] = pool.tip[:40, None]
    world.u = pool.delta_a[:40].copy()
    rewards, errors, _, _ = world.step(np.zeros((40, 2)))
    assert errors.max() < 1e-3 and rewards.min() > 0.99


def test_a_smaller_error_is_rewarded(model):
    world = begun(model, "reach", 2, randomise=Randomised(parameters=False))
    pool = world.task._pool
    world.goals.path[:] = pool.tip[:1, None]
    world.u = np.stack([pool.delta_a[0], pool.delta_a[0] + 0.5])
    rewards, errors, _, _ = world.step(np.zeros((2, 2)))
    assert errors[0] < errors[1] and rewards[0] > rewards[1]


def test_actions_change_commands_by_at_most_a_step(model):
    world = begun(model, "reach", step=0.03)
    before = world.u.copy()
    world.step(np.full((40, 2), 7.0))
    width = world.scales.reach - world.scales.low
    assert (world.u - before <= 0.03 * width + 1e-12).all() and (world.u <= world.scales.reach).all()
    world.step(np.full((40, 2), np.nan))
    assert np.isfinite(world.u).all()


def test_a_pressed_plane_is_not_passed_and_carries_the_force_that_compliance_gives(model):
    world = begun(model, "press")
    goals, states = world.goals, world.states
    states.tip = goals.path[:, 0] - goals.depth[:, None] * goals.normal
    assert world.task.errors(states, goals, world.t).max() < 1e-9
    force = world.task.force(states, goals)
    soft = np.einsum("bi,bij,bj->b", goals.normal, states.compliance, goals.normal)
    assert force * soft == pytest.approx(goals.depth)
    seen = world.task.tip(states, goals)
    assert np.abs(((seen - goals.path[:, 0]) * goals.normal).sum(axis=1)).max() < 1e-9


def test_a_carried_weight_can_be_brought_where_it_shall_go_and_is_not_observed(model):
    world = begun(model, "carry", randomise=Randomised(parameters=False))
    goals, n = world.goals, world.length
    weight = -goals.load[:, 0]
    assert goals.load.shape == (40, 1) and (weight >= 0).all() and weight.max() > 0
    assert goals.path[:, n // 5] == pytest.approx(goals.path[:, 0], abs=1e-2)
    assert goals.path[:, -n // 5] == pytest.approx(goals.path[:, -1], abs=1e-2)
    # the curve was found under forces: the displacements there, told, lead to it with the weight and not without
    start = world.robots.start(40)
    start.delta_a[:] = model.domain.states[0, :2]
    shares = np.full((40, 2), 0.4) * world.robots.largest_force
    there = world.robots.move(start, shares, world.p, forces=True, loads=goals.load)
    again = world.robots.move(world.robots.start(40), there.delta_a, world.p, loads=goals.load)
    bare = world.robots.move(world.robots.start(40), there.delta_a, world.p)
    assert again.tip == pytest.approx(there.tip, abs=1e-4)
    assert np.linalg.norm(bare.tip - there.tip, axis=1).max() > 0.01 * world.scales.scale
    seen = world.observe()
    world.goals.load *= 2
    assert np.array_equal(world.observe(), seen)


def test_a_policy_may_be_told_the_parameters_of_its_robot(model):
    low, high = np.array([[one.low, one.high] for one in model.parameters]).T
    world = begun(model, "reach", designs=[low, high], observe_parameters=True)
    told = world.observe()[:, -len(low) :]
    assert world.sizes[0] == 14 + len(low) and set(np.unique(told)) == {-1.0, 1.0}
    assert np.array_equal(told[:, 0] < 0, np.isclose(world.p[:, 0], low[0]))


def test_goals_of_each_robot_are_within_its_own_reach(model):
    """Of parameters that change where the robot can be: commands found for its own parameters lead there."""
    world = begun(model, "reach")
    pool, p = world.task._pool, world.task._p
    found = world.robots.move(world.robots.start(len(p)), pool.delta_a, p)
    assert found.tip == pytest.approx(pool.tip, abs=1e-3)
    other = world.robots.move(world.robots.start(len(p)), pool.delta_a, p[::-1])
    assert np.abs(other.lambda_a - pool.lambda_a).max() > 0.1 * pool.lambda_a.max()


def pulled(far):
    """Shares of the largest forces by which as many robots as `far` (a share of them) are pulled beyond their reach."""

    def shares(task, rng, size):
        beyond = np.arange(size[0]) < far * size[0]
        return np.broadcast_to(np.where(beyond, 5.0, 0.3)[:, None], (task.length + 1, *size))

    return shares


def test_curves_that_lead_beyond_the_reach_are_no_goals(model, monkeypatch):
    monkeypatch.setattr(Follow, "_shares", pulled(0.5))
    world = begun(model, "follow")
    task = world.task
    assert len(task._curves) == len(task._p) == Follow.curves // 2
    assert np.ptp(task._curves, axis=1).max() < world.scales.scale
    monkeypatch.setattr(Follow, "_shares", pulled(1.0))
    with pytest.raises(InputError, match="none of 1024 curves drawn lies within the reach"):
        begun(model, "follow")


@pytest.mark.parametrize(
    "options, part",
    [
        ({"step": 0.0}, "step: must be a number above 0 and at most 1, got 0"),
        ({"step": 1.5}, "got 1.5"),
        ({"length": -1}, "length: must be a number above 0, got -1"),
        ({"randomise": {"noise": -1}}, "randomise.noise: must be a number of 0 or more, got -1"),
        ({"randomise": Randomised(gain=float("nan"))}, "randomise.gain: must be a number of 0 or more, got nan"),
    ],
)
def test_numbers_that_no_robot_has_are_refused(model, options, part):
    with pytest.raises(InputError, match=part):
        World(model, "reach", 2, **options)


def test_designs_of_another_shape_are_refused(model):
    with pytest.raises(InputError, match="designs must be rows of"):
        World(model, "reach", 1, designs=np.zeros((3, 7)))


def test_an_unknown_key_of_randomise_is_refused(model):
    with pytest.raises(InputError, match=r"randomise: unknown key 'nois' \(known are parameters, slack, gain, noise\)"):
        World(model, "reach", 2, randomise={"nois": 0.1})


def test_what_is_randomised_differs_from_episode_to_episode(model):
    world = begun(model, "reach", randomise=Randomised(slack=0.2, gain=0.05, noise=0.1))
    assert len(np.unique(world.p[:, 1])) > 30 and len(np.unique(world.slack)) == 80 and (world.slack >= 0).all()
    assert np.abs(world.gain - 1).max() <= 0.05
    assert np.abs(world.observe() - world.observe()).max() > 0
    plain = begun(model, "reach", randomise=Randomised(parameters=False))
    assert np.ptp(plain.p, axis=0).max() == 0.0 and np.array_equal(plain.observe(), plain.observe())


def test_an_unknown_task_is_refused(model):
    with pytest.raises(InputError, match="no task 'dance'"):
        World(model, "dance", 1)


def test_the_goal_that_is_observed_is_that_of_the_end_of_the_tick(model):
    """As a loop of `cfem control` tells it to a policy, with where it goes on to in the tick after that."""
    world = begun(model, "follow", randomise={"parameters": False})
    seen, n_e = world.observe(), world.model.rows.n_e
    goal = seen[:, :n_e] * world.scales.scale + world.states.tip
    assert goal == pytest.approx(world.goals.path[:, 1], abs=1e-4)
    ahead = seen[:, 2 * n_e : 3 * n_e] * world.scales.near
    small = np.abs(ahead).max(axis=1) < LARGEST * world.scales.near
    assert ahead[small] == pytest.approx((world.goals.path[:, 2] - world.goals.path[:, 1])[small], abs=1e-4)
