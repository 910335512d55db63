"""Parameters that are tracked while the robot works, and what the guards keep from the controller."""

import numpy as np
import pytest
from surrogate.stored import train_folder
from surrogate.synthetic import stiffer

from cfem.condensed.model import under_force
from cfem.control.adaptation.tracker import Tracker
from cfem.core.errors import InputError
from cfem.predict.at_parameters import AtParameters
from cfem.predict.estimation.kalman import Gaussian
from cfem.predict.load import load_model

NOISE = 0.02


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    folder = train_folder(
        tmp_path_factory.mktemp("adapt"), "{kind: spectral, max_degree: 8}", train=80, parameters=True
    )
    return load_model(folder)


def forces(model, count, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(0.2, 0.7, (count, model.rows.n_a)) * model.domain.lambda_a[1]


def feed(tracker, model, p_of, count=60, seed=0, noise=NOISE, lost=0.0, spoil=lambda n, x: x):
    """Samples of a robot whose parameters are p_of(n); what the tracker used after each."""
    rng, real, used = np.random.default_rng(seed), AtParameters(model, p_of(0)), []
    near = model.at_displacement(0.2 * model.reach[:, 1], p_of(0))
    for n, u in enumerate(forces(model, count, seed)):
        real.p = p_of(n)
        there = under_force(real, u - lost, real.at_displacement(near.delta_a))
        tracker.sample(u, spoil(n, there.delta_e + noise * rng.normal(size=model.rows.n_e)), near)
        near = there
        used.append(tracker.used_p)
    return np.array(used)


def reference(model):
    return np.array([one.reference for one in model.parameters])


def test_parameters_of_another_robot_are_found_and_used(model):
    """The synthetic robot's forces tell the product of Young's modulus and a function of Poisson's ratio."""
    assert [one.name for one in model.parameters] == ["poisson", "young"]
    tracker, real = Tracker(model, "force", NOISE), np.array([0.44, 4.5])
    used = feed(tracker, model, lambda n: real)
    stiffness = [p[1] * stiffer(p[None, :1])[0] for p in (tracker.p, real, reference(model))]
    assert stiffness[0] == pytest.approx(stiffness[1], rel=0.01) and stiffness[2] < 0.7 * stiffness[1]
    assert used[-1] == pytest.approx(tracker.p) and tracker.rejected < 5


def test_a_drift_is_followed_without_a_lag(model):
    place = [one.name for one in model.parameters].index("young")
    first = reference(model)

    def p_of(n):
        p = first.copy()
        p[place] *= 1 - 0.3 * n / 150
        return p

    used = feed(Tracker(model, "force", NOISE, forget=20), model, p_of, 150)
    assert used[-1, place] == pytest.approx(p_of(149)[place], rel=0.01)


def test_what_an_actuator_loses_is_found(model):
    lost = 0.05 * model.domain.lambda_a[1]
    tracker = Tracker(model, "force", NOISE, find=("poisson",), loss=float(2 * lost.max()))
    feed(tracker, model, lambda n: reference(model), 80, lost=lost)
    assert tracker.used_b == pytest.approx(lost, rel=0.15)


def test_bounds_hold(model):
    """A robot far softer than any that the model knows."""
    place = [one.name for one in model.parameters].index("young")
    tracker, rng = Tracker(model, "force", NOISE), np.random.default_rng(0)
    near = model.at_displacement(0.2 * model.reach[:, 1])
    for u in forces(model, 40):
        tracker.sample(u, 5 * near.delta_e + rng.normal(size=model.rows.n_e), near)
        for one, value in zip(model.parameters, tracker.used_p, strict=True):
            assert one.low * 0.999 <= value <= one.high * 1.001
    assert (
        np.isfinite(tracker.known.covariance).all()
        and np.linalg.eigvalsh(tracker.known.covariance).min() > -1e-9
        and place >= 0
    )


def test_outliers_and_lost_samples_change_nothing(model):
    def spoil(n, x):
        return np.full_like(x, np.nan) if n % 7 == 3 else x + 40.0 if n % 5 == 4 else x

    clean, dirty = Tracker(model, "force", NOISE), Tracker(model, "force", NOISE)
    real = reference(model) * 1.02
    feed(clean, model, lambda n: real)
    feed(dirty, model, lambda n: real, spoil=spoil)
    assert dirty.p == pytest.approx(clean.p, rel=0.03) and dirty.rejected >= 10


def test_a_sample_whose_state_the_model_does_not_know_is_counted(model):
    tracker, near = Tracker(model, "force", NOISE), model.at_displacement(0.3 * model.reach[:, 1])
    beyond = np.full(len(near.lambda_a), 1e6)
    assert not tracker.sample(beyond, near.delta_e, near) and tracker.rejected == 1
    tracker.sample(near.lambda_a, near.delta_e, near)
    assert tracker.rejected == 1


def test_a_robot_that_has_become_another_is_found_again(model):
    """E jumps by a third: samples are rejected until the gate opens the estimate, and then the stiffness is found."""
    place, count = [one.name for one in model.parameters].index("young"), 40
    tracker, jumped = Tracker(model, "force", NOISE), reference(model)
    jumped[place] *= 1.33
    feed(tracker, model, lambda n: reference(model) if n < count else jumped, 2 * count)
    assert tracker.rejected >= tracker.gate.samples - 1
    stiffness = [p[1] * stiffer(p[None, :1])[0] for p in (tracker.p, jumped)]
    assert stiffness[0] == pytest.approx(stiffness[1], rel=0.01)


def test_without_excitation_the_first_values_are_used(model):
    """The same force again and again tells one combination; displacements tell nothing of Young's modulus."""
    place = [one.name for one in model.parameters].index("young")
    tracker, real = Tracker(model, "displacement", NOISE, find=("young",)), reference(model)
    near = model.at_displacement(0.3 * model.reach[:, 1])
    rng = np.random.default_rng(1)
    for _ in range(50):
        tracker.sample(near.delta_a, near.delta_e + NOISE * rng.normal(size=model.rows.n_e), near)
    assert tracker.used_p[place] == pytest.approx(real[place], rel=1e-12) and tracker.deviation[0] == pytest.approx(0.3)


def test_forgetting_does_not_wind_up(model):
    tracker = Tracker(model, "force", NOISE, forget=5)
    near = model.at_displacement(0.3 * model.reach[:, 1])
    rng = np.random.default_rng(2)
    for _ in range(300):
        tracker.sample(near.lambda_a, near.delta_e + NOISE * rng.normal(size=model.rows.n_e), near)
    assert (tracker.deviation[: len(model.parameters)] <= 0.3 + 1e-9).all()


def test_an_estimate_that_predicts_worse_than_the_first_values_is_not_used(model):
    tracker = Tracker(model, "force", NOISE)
    feed(tracker, model, lambda n: reference(model) * 1.03, 20)
    tracker._misses.update(tracked=2.0, first=1.0)
    for _ in range(60):
        tracker._use()
    assert tracker.used_p == pytest.approx(reference(model))


def test_a_robot_that_no_parameters_explain_changes_nothing(model):
    """Samples that are off by a quarter of the length, this way and that."""
    tracker, rng = Tracker(model, "force", NOISE), np.random.default_rng(5)
    feed(tracker, model, lambda n: reference(model) * 1.03, 30)
    far = feed(
        tracker, model, lambda n: reference(model), 90, spoil=lambda n, x: x + 0.25 * model.length * rng.normal(size=3)
    )
    assert np.abs(far[-1] / reference(model) - 1).max() < 0.05


def test_what_was_found_is_kept_when_a_change_opens_the_estimate_again(model):
    tracker, real = Tracker(model, "force", NOISE), reference(model) * 1.04
    found = feed(tracker, model, lambda n: real, 60)[-1]
    tracker.known = Gaussian(tracker.known.mean, np.diag(tracker.unknowns.sd**2))
    tracker._use()
    assert tracker.used_p == pytest.approx(found)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [({"find": ("elasticity",)}, "no parameter 'elasticity'"), ({"noise": 0.0}, "noise must be positive")],
)
def test_wrong_settings_get_one_sentence(model, wrong, said):
    with pytest.raises(InputError, match=said):
        Tracker(**{"predictor": model, "command": "force", "noise": NOISE, **wrong})
