"""Batches of robots that move against the step of one robot, which was written apart and is held against finite
elements elsewhere."""

import numpy as np
import pytest
from gym.moving import moving
from surrogate.stored import train_folder

import cfem.gym.moving_robots as batches
from cfem.core.errors import InputError
from cfem.gym.moving_robots import MovingRobots
from cfem.motion import step as single
from cfem.motion.altered import Altered
from cfem.motion.modes import natural_modes
from cfem.predict.load import load_model

DT, COUNT = 0.005, 70


@pytest.fixture(scope="module")
def static(tmp_path_factory):
    return load_model(train_folder(tmp_path_factory.mktemp("plain"), "{kind: spectral, max_degree: 8}", train=60))


@pytest.fixture(scope="module")
def model(static):
    return moving(static)


def commands(robots, ticks, seed=0):
    rng = np.random.default_rng(seed)
    top = robots.static.largest_force if robots.forces else robots.model.static.reach[:, 1]
    u = rng.uniform(0.3, 0.5, (COUNT, 2))
    for _ in range(ticks):
        yield u * top
        u = np.clip(u + rng.uniform(-0.03, 0.03, u.shape), 0.2, 0.6)


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_each_robot_moves_as_one_alone(model, kind, monkeypatch):
    """Stiffness and viscosity of its own; commands change evenly in a tick of two steps."""
    monkeypatch.setattr(batches, "prewarp", lambda frequency, dt: 1.0)
    robots, rng = MovingRobots(model, kind, 2 * DT, 2, tolerance=1e-6), np.random.default_rng(1)
    robots.static.pulls = False  # the single step holds all cables
    stiffness, viscosity = rng.uniform(0.8, 1.2, COUNT), rng.uniform(0.7, 1.3, COUNT)
    steps = list(commands(robots, 20))
    states = robots.standing(steps[0], stiffness, viscosity)
    for b in (0, 68):  # of both blocks of lanes
        states = robots.standing(steps[0], stiffness, viscosity)
        alone = Altered(model, stiffness[b], viscosity[b])
        one, before = single.at_rest(alone, model.scale[:2] * states.q[:2, b]), steps[0][b]
        moved = 0.0
        for u in steps[1:]:
            robots.move(states, u)
            for share in (0.25, 0.75) if kind == "force" else (0.5, 1.0):
                one = single.step(alone, one, single.MotionCommand(**{kind: before + share * (u[b] - before)}), DT)
            before, tip = u[b], single.effectors(alone, one)
            assert states.failed == 0 and states.tip[b] == pytest.approx(tip, abs=1e-4)
            moved = max(moved, np.abs(one.q[2:]).max())
        assert moved > 0.05 and robots.forces_of(states)[b] == pytest.approx(one.lam, rel=1e-3, abs=1e-3)


def test_one_robot_and_many_run_the_same_machine_code(model):
    """numba compiles once more for arrays of another order, which takes as long as the first time."""
    for count in (1, 3):
        robots = MovingRobots(model)
        u = np.full((count, 2), 0.4) * robots.static.largest_force
        states = robots.standing(u, np.ones(count), np.ones(count))
        for _ in range(2):
            robots.move(states, u)
    assert len(robots._ticks.signatures) == 1


def test_what_the_tolerance_leaves_out_is_small(model):
    coarse, fine = MovingRobots(model), MovingRobots(model, tolerance=1e-6)
    steps = list(commands(coarse, 30))
    states, wanted = (robots.standing(steps[0], np.ones(COUNT), np.ones(COUNT)) for robots in (coarse, fine))
    for u in steps[1:]:
        coarse.move(states, u)
        fine.move(wanted, u)
    off = np.linalg.norm(states.tip - wanted.tip, axis=1)
    assert 0 < np.median(off) < 1e-3 * np.ptp(wanted.tip) and off.max() < 1e-2 * np.ptp(wanted.tip)


def test_a_robot_at_rest_stays_there(model):
    robots = MovingRobots(model)
    u = np.full((3, 2), 0.4) * robots.static.largest_force
    states = robots.standing(u, np.array([0.9, 1.0, 1.1]), np.ones(3))
    before = states.tip.copy()
    for _ in range(5):
        robots.move(states, u)
    assert states.tip == pytest.approx(before, abs=1e-3) and np.ptp(before[:, 1]) > 1.0


def test_the_lowest_frequency_is_right_at_long_ticks(model):
    """Small free oscillations: the tip crosses its rest as often as the modes of the model say."""
    robots = MovingRobots(model, "force", 0.01)
    u = 0.4 * robots.static.largest_force[None]
    robots = MovingRobots(model, "force", 0.1 / robots.frequency)
    robots._learned = robots._learned._replace(relaxation=np.zeros(1))
    states = robots.standing(u, np.ones(1), np.ones(1))
    wanted = natural_modes(model, model.scale[:2] * states.q[:2, 0], held=False)
    shape = wanted.shapes[:, 0] / model.scale
    states.q[:, 0] += 0.02 * shape / np.abs(shape).max()
    along = []
    rest = states.q[:, 0].copy()
    for _ in range(200):
        robots.move(states, u)
        along.append(float(shape @ (states.q[:, 0] - rest)))
    spectrum = np.abs(np.fft.rfft(np.array(along) - np.mean(along), 8192))
    found = np.argmax(spectrum) / (8192 * robots.tick)
    about = natural_modes(model, model.static.domain.states[0, :2], held=False).frequency[0]
    assert found == pytest.approx(wanted.frequency[0], rel=0.02 + abs(wanted.frequency[0] / about - 1))


def test_a_cable_goes_slack_instead_of_pushing(model):
    """The conditions of complementarity hold at each tick, and cables are held again."""
    robots, rng = MovingRobots(model, "displacement", DT), np.random.default_rng(3)
    top = model.static.reach[:, 1]
    u = rng.uniform(0.2, 0.4, (COUNT, 2)) * top
    states, slack, again = robots.standing(u, np.ones(COUNT), np.ones(COUNT)), 0, 0
    before = states.held.copy()
    for _ in range(30):
        u = np.clip(u + rng.uniform(-0.1, 0.1, u.shape) * top, 0.0, 0.6 * top)
        robots.move(states, u)
        delta, known = (states.q[:2] * model.scale[:2, None]).T, states.outside < 1.1
        largest = robots.static.largest_force.max()
        assert (robots.forces_of(states)[known] >= -1e-4 * largest).all()
        assert (delta[known] >= u[known] - 1e-6).all()
        slack += int((states.held == 0).sum())
        again += int(((states.held > 0) & (before == 0)).sum())
        before = states.held.copy()
    assert slack > 10 and again > 3


def test_what_relaxes_is_refused(static):
    with pytest.raises(InputError, match="do not support Prony terms"):
        MovingRobots(moving(static, ((0.2, 0.05),)))
