"""Batches of robots against the model itself, one by one."""

import numpy as np
import pytest
from surrogate.stored import train_folder

from cfem.condensed.model import under_force
from cfem.core.errors import InputError
from cfem.gym.robots import Robots
from cfem.predict.load import load_model


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    options = "{kind: spectral, max_degree: 8}"
    plain = train_folder(tmp_path_factory.mktemp("plain"), options, train=60)
    return plain, train_folder(tmp_path_factory.mktemp("p"), options, train=80, parameters=True)


@pytest.fixture(scope="module")
def model(folders):
    return load_model(folders[0])


def test_taut_cables_stand_where_they_are_told(model):
    robots = Robots(model, ("effector_compliance",))
    states = robots.feasible(np.random.default_rng(0), np.zeros((150, 0)))
    found = robots.move(robots.start(150), states.delta_a)
    assert robots.pulls and found.failed == 0
    assert found.delta_a == pytest.approx(states.delta_a)
    for i in (0, 70, 149):
        here = model.at_displacement(states.delta_a[i])
        assert found.tip[i] == pytest.approx(here.delta_e) and found.lambda_a[i] == pytest.approx(here.lambda_a)
        G, e = here.effector_jacobian, here.rows.e
        assert found.compliance[i] == pytest.approx(here.W[e, e] - G @ here.W_aa @ G.T)


def test_forces_are_found_as_the_model_finds_them(model):
    robots, rng = Robots(model), np.random.default_rng(1)
    u = rng.uniform(0.1, 0.6, (100, 2)) * robots.largest_force
    start = robots.start(100)
    start.delta_a[:] = model.domain.states[0, :2]
    found = robots.move(start, u, forces=True)
    assert found.failed == 0 and np.abs(found.lambda_a - u).max() <= 1e-6 * robots.largest_force.max()
    here = under_force(model, u[5], model.at_displacement(model.domain.states[0, :2]))
    assert found.delta_a[5] == pytest.approx(here.delta_a, abs=1e-5)


def test_a_cable_that_would_have_to_push_goes_slack(model):
    """Conditions of Karush, Kuhn and Tucker, by the model's own forces."""
    robots, rng = Robots(model), np.random.default_rng(2)
    u = rng.uniform(0, 1, (300, 2)) * model.domain.delta_a[1]
    found = robots.move(robots.start(300), u)
    slack = found.delta_a > u + 1e-9
    assert found.failed == 0 and 20 < slack.any(axis=1).sum() < 290
    assert (found.delta_a >= u - 1e-12).all() and (found.lambda_a > -1e-4).all()
    assert np.abs(found.lambda_a[slack]).max() < 1e-4
    i = int(np.flatnonzero(slack.any(axis=1))[0])
    assert model.at_displacement(found.delta_a[i]).lambda_a == pytest.approx(found.lambda_a[i], abs=1e-9)


def test_where_a_robot_was_changes_nothing(model):
    robots, rng = Robots(model), np.random.default_rng(3)
    u = rng.uniform(0, 0.8, (200, 2)) * model.domain.delta_a[1]
    fresh = robots.move(robots.start(200), u)
    before = robots.move(robots.start(200), u[::-1])
    assert robots.move(before, u).tip == pytest.approx(fresh.tip, abs=1e-4)


def test_a_load_at_held_forces_moves_the_effector_by_the_models_compliance(model):
    """W_ee is the compliance at held forces, which the batch does not use: it knows that at locked actuators."""
    robots, rng = Robots(model, loaded=range(3)), np.random.default_rng(6)
    u = np.full((3, 2), 0.4) * robots.largest_force
    start = robots.start(3)
    start.delta_a[:] = model.domain.states[0, :2]
    without = robots.move(start, u, forces=True)
    load = 1e-3 * rng.standard_normal((3, 3))
    found = robots.move(start, u, forces=True, loads=load)
    W = model.at_displacement(without.delta_a[0]).W[:3, :3]
    assert found.failed == 0 and np.abs(W @ load.T).max() > 1e-3
    assert found.tip - without.tip == pytest.approx(load @ W, rel=1e-2, abs=1e-6)


def test_a_load_that_pulls_a_cable_taut_or_slack_leaves_no_negative_tension(model):
    robots, rng = Robots(model, loaded=range(3)), np.random.default_rng(7)
    u = rng.uniform(0, 1, (200, 2)) * model.domain.delta_a[1]
    load = rng.standard_normal((200, 3))
    load *= 0.05 * robots.largest_force.max() / np.abs(load).max()
    found, without = robots.move(robots.start(200), u, loads=load), robots.move(robots.start(200), u)
    slack = found.delta_a > u + 1e-9
    assert found.failed == 0 and (slack != (without.delta_a > u + 1e-9)).any()
    assert found.lambda_a.min() > -1e-4 and np.abs(found.lambda_a[slack]).max() < 1e-4
    i = int(np.flatnonzero(~slack.any(axis=1))[0])
    here = model.at_displacement(u[i])
    assert found.lambda_a[i] == pytest.approx(here.lambda_a - here.effector_jacobian.T @ load[i])


def test_loads_on_one_row_are_those_of_a_robot_with_all_rows(model):
    """Rows and columns of the compliance, slopes and their derivatives, each in its place."""
    rng = np.random.default_rng(8)
    u = rng.uniform(0, 1, (50, 2)) * model.domain.delta_a[1]
    load = np.zeros((50, 3))
    load[:, 2] = -1e-3 * rng.random(50)
    one, all_rows = Robots(model, loaded=(2,)), Robots(model, loaded=range(3))
    found, wanted = one.move(one.start(50), u, loads=load[:, 2:]), all_rows.move(all_rows.start(50), u, loads=load)
    assert found.tip == pytest.approx(wanted.tip) and found.lambda_a == pytest.approx(wanted.lambda_a, abs=1e-6)


def test_each_robot_has_parameters_of_its_own(folders):
    model = load_model(folders[1])
    robots, rng = Robots(model), np.random.default_rng(4)
    p = robots.random_parameters(rng, 60)
    states = robots.feasible(rng, p)
    low, high = np.array([[one.low, one.high] for one in model.parameters]).T
    assert ((p >= low) & (p <= high)).all() and np.ptp(p, axis=0) == pytest.approx(high - low, rel=0.2)
    found = robots.move(robots.start(60), states.delta_a, p)
    taut = np.flatnonzero((found.delta_a == states.delta_a).all(axis=1))
    for i in taut[:3]:
        here = model.at_displacement(states.delta_a[i], p[i])
        assert found.tip[i] == pytest.approx(here.delta_e) and found.lambda_a[i] == pytest.approx(here.lambda_a)


def test_other_models_are_refused():
    class Network:
        meta, form = {"kind": "mlp"}, "displacement"

    with pytest.raises(InputError, match="need a spectral model of form displacement, got kind 'mlp'"):
        Robots(Network())
