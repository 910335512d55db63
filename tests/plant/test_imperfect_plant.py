import numpy as np
import pytest
from support.arc_robot import ArcRobot
from support.linear_robot import REST_E, W_AA, W_EA, LinearRobot
from surrogate.stored import train_folder

from cfem.plant.imperfect_plant import DriftingPlant, Imperfection, ImperfectPlant, Stiffer
from cfem.plant.model_plant import ModelPlant
from cfem.predict.load import load_model

RAMP = [np.array([0.1 * k, -0.2 * k]) for k in range(1, 31)]


class Counted(ModelPlant):
    steps = 0

    def step(self, u, kind="displacement"):
        self.steps += 1
        return super().step(u, kind)


def imperfect(seed=0, **imperfection):
    return ImperfectPlant(ModelPlant(LinearRobot(), REST_E), Imperfection(**imperfection), seed)


def of(u):
    return REST_E + W_EA @ np.linalg.solve(W_AA, u)


def test_a_perfect_one_changes_nothing():
    plant, bare = imperfect(), ModelPlant(LinearRobot(), REST_E)
    for u in RAMP:
        got, expected = plant.step(u), bare.step(u)
        assert np.array_equal(got.x_e, expected.x_e) and got.t == expected.t


def test_a_delay_hands_over_the_sample_of_then_with_its_tick():
    plant = imperfect(delay=2)
    seen = [plant.step(u) for u in RAMP]
    assert [one.t for one in seen] == [0, 0, *range(1, 29)]
    assert np.isnan(seen[0].x_e).all() and seen[0].status != "converged"
    np.testing.assert_allclose(seen[10].x_e, of(RAMP[8]))


def test_a_slow_sensor_repeats_itself():
    plant = imperfect(samples_a_tick=0.3)
    ticks = [plant.step(u).t for u in RAMP]
    assert len(set(ticks) - {0}) == 9
    assert ticks == sorted(ticks) and ticks[-1] == 30


def test_noise_is_of_its_size_and_the_truth_has_none():
    plant = imperfect(noise=0.1)
    off = []
    for _ in range(2000):
        off.append(plant.step(RAMP[3]).x_e - plant.actual.x_e)
        np.testing.assert_allclose(plant.actual.x_e, of(RAMP[3]))
    assert np.std(off, axis=0) == pytest.approx([0.1, 0.1], rel=0.05)
    assert np.mean(off, axis=0) == pytest.approx([0, 0], abs=0.01)


def test_same_seed_same_samples():
    plants = (imperfect(seed, noise=0.1) for seed in (1, 1, 2))
    first, again, other = ([plant.step(u).x_e for u in RAMP] for plant in plants)
    assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_commands_are_rounded_and_cut_off():
    plant = imperfect(quantum=0.25, low=-1.0, high=2.0)
    plant.step(np.array([0.36, -0.1]))
    np.testing.assert_allclose(plant.actual.delta_a, [0.25, 0.0], atol=1e-12)
    plant.step(np.array([5.0, -5.0]))
    np.testing.assert_allclose(plant.actual.delta_a, [2.0, -1.0])


def test_the_same_command_asks_the_plant_once():
    inner = Counted(LinearRobot(), REST_E)
    plant = ImperfectPlant(inner, Imperfection(), 0)
    ticks = [plant.step(RAMP[0]).t for _ in range(5)]
    assert inner.steps == 1 and ticks == [1, 2, 3, 4, 5]
    plant.step(RAMP[0], "force")
    assert inner.steps == 2


def test_a_push_from_its_tick_on():
    push = np.array([0.3, 0.1])
    pushed = ModelPlant(LinearRobot(), REST_E, push)
    plant = ImperfectPlant(ModelPlant(LinearRobot(), REST_E), Imperfection(), 0, pushed, since=3)
    x_e = [plant.step(np.ones(2), "force").x_e for _ in range(4)]
    W = LinearRobot().W
    np.testing.assert_allclose(x_e[1], x_e[0])
    np.testing.assert_allclose(x_e[2] - x_e[1], W[:2, :2] @ push)
    # Held displacements let the effector give by C_ee alone.
    held = pushed.step(np.ones(2)).x_e - ModelPlant(LinearRobot(), REST_E).step(np.ones(2)).x_e
    np.testing.assert_allclose(held, 0.05 * push, atol=1e-12)


def test_stiffer_keeps_the_shape_and_scales_the_forces():
    model, delta_a = ArcRobot(), np.array([6.0, 5.0])
    one, other = model.at_displacement(delta_a), Stiffer(model, 1.3).at_displacement(delta_a)
    np.testing.assert_allclose(other.delta, one.delta)
    np.testing.assert_allclose(other.lambda_a, 1.3 * one.lambda_a)
    np.testing.assert_allclose(other.W[:, 3:], ArcRobot(stiffness=1.3).at_displacement(delta_a).W[:, 3:])


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return load_model(train_folder(tmp_path_factory.mktemp("drift"), "{kind: spectral, max_degree: 8}", train=40))


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_it_ends_as_a_robot_of_that_stiffness(model, kind):
    u = 0.3 * (model.domain.lambda_a if kind == "force" else model.domain.delta_a)[1]
    drifting = DriftingPlant(ModelPlant(model, model.rest_e), 0.7, 3)
    found = [drifting.step(u, kind) for _ in range(5)]
    there = ModelPlant(Stiffer(model, 0.7), model.rest_e).step(u, kind)
    for one in found[2:]:
        assert one.x_e == pytest.approx(there.x_e) and one.lambda_a == pytest.approx(there.lambda_a)
    if kind == "force":
        assert np.linalg.norm(found[0].x_e - there.x_e) > 0.1
