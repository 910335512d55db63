"""What the observer finds out about a robot that is not the model's, from noisy and late samples."""

import numpy as np
import pytest
from control.motion.bar import clocked, plant, robot, standing

from cfem.control.motion.observer import Doubt, Observer
from cfem.core.errors import InputError
from cfem.plant.protocol import Measurement
from cfem.predict.estimation.gate import SampleVerdict

NOISE = 0.02


def watched(ticks=240, delay=1, kind="force", **body):
    """An observer after commands that swing, the robot, and the errors of its guess of the present effectors."""
    middle = 2.4 if kind == "force" else 1.5
    at = clocked(kind)
    observer = Observer(at, at.at_rest(standing(middle, kind)), np.ones(3), Doubt(noise=NOISE))
    there, measured, missed = plant(middle, kind, noise=NOISE, delay=delay, **body), None, []
    for k in range(ticks):
        observer.correct(measured, robot().rest_e)
        if k:
            e, _ = at.effectors(observer.now().z[None])
            missed.append(np.linalg.norm(robot().rest_e + e[0] + observer.offset - there.actual.x_e))
        u = np.array([middle * (1 + 0.3 * np.sin(0.25 * k) * min(k / 30, 1.0))])
        observer.command(u)
        measured = there.step(u, kind)
    return observer, np.array(missed)


def test_stiffness_and_viscosity_are_found():
    observer, missed = watched(stiffness=1.1, viscosity=1.3)
    assert observer.material.stiffness == pytest.approx(1.1, abs=0.015)
    assert observer.material.viscosity == pytest.approx(1.3, rel=0.15)
    assert missed[120:].mean() < 1.5 * NOISE  # a sample alone is off by 1.7


def test_of_the_model_s_own_robot_it_finds_nothing():
    observer, missed = watched(delay=0)
    assert observer.material.stiffness == pytest.approx(1.0, abs=0.015)
    assert np.abs(observer.offset).max() < 0.06 and missed[120:].mean() < 1.5 * NOISE


def test_late_samples_are_of_their_own_tick():
    """Three ticks late, it is as far from the truth as the motion since then lets it be, not three ticks behind."""
    _, missed = watched(delay=3, stiffness=1.1)
    assert missed[120:].mean() < 2 * NOISE


def test_displacements_are_followed_too():
    observer, missed = watched(kind="displacement", stiffness=1.2)
    assert missed[120:].mean() < 1.5 * NOISE and 1.0 < observer.material.stiffness < 1.4


def test_what_it_does_not_know_is_an_offset():
    """Markers that sit elsewhere by a millimetre."""
    at = clocked()
    observer, there = Observer(at, at.at_rest(standing(2.4)), np.ones(3), Doubt(noise=NOISE, stiffness=0.0)), plant(2.4)
    shift = np.array([0.0, 1.0, -0.5])
    for _ in range(200):
        observer.command(np.array([2.4]))
        found = there.step(np.array([2.4]), "force")
        seen = Measurement(found.x_e + shift, None, None, found.t, "converged")
        observer.correct(seen, robot().rest_e)
    np.testing.assert_allclose(observer.offset, shift, atol=0.02)


def test_its_covariance_is_that_of_its_errors():
    """Of the effectors' positions over seeds: between a half and twice what it claims."""
    observer, missed = watched(delay=0)
    _, C = clocked().effectors(observer.state.z[None])
    H = np.zeros((3, len(observer.covariance)))
    H[:, : observer.state.z.size], H[:, -3:] = C[0], np.eye(3)
    claimed = np.sqrt(np.trace(H @ observer.covariance @ H.T))
    assert 0.3 * claimed < np.sqrt((missed[100:] ** 2).mean()) < 2 * claimed
    np.testing.assert_array_equal(observer.covariance, observer.covariance.T)


def test_under_forces_without_an_equilibrium_it_begins_in_the_middle_of_the_training_states():
    at = clocked()
    observer = Observer(at, at.at_rest(standing(2.4)), np.ones(3), Doubt(noise=NOISE))
    observer.reset(np.array([1e9]))
    low, high = at.model.static.domain.delta_a
    np.testing.assert_allclose(observer.state.z[: at.n_a], (low + high) / 2)


def test_samples_are_used_once_and_lost_ones_are_no_harm():
    at = clocked()
    observer = Observer(at, at.at_rest(standing(2.4)), np.ones(3), Doubt(noise=NOISE))
    observer.command(np.array([2.4]))
    seen = Measurement(robot().rest_e + standing(2.4).delta_e + 0.01, None, None, 1, "converged")
    observer.correct(seen, robot().rest_e)
    before = observer.state.z.copy()
    observer.correct(seen, robot().rest_e)
    np.testing.assert_array_equal(observer.state.z, before)
    observer.command(np.array([2.4]))
    observer.correct(Measurement(np.full(3, np.nan), None, None, 2, "nothing"), robot().rest_e)
    assert observer.sampled == 2 and np.isfinite(observer.state.z).all()
    with pytest.raises(InputError, match="of tick 7, and 2 commands were given"):
        observer.correct(Measurement(seen.x_e, None, None, 7, "converged"), robot().rest_e)


def test_a_robot_that_moves_otherwise_is_noticed():
    """Innovations are as large as stated of the model's own robot, and one that is 3 mm elsewhere is astray."""
    observer, _ = watched(120, delay=0)
    assert observer.innovation < 5 and not observer.astray
    e, _ = clocked().effectors(observer.now().z[None])
    tick = observer.sampled + len(observer._commands) + 1
    observer.command(np.array([2.4]))
    seen = robot().rest_e + e[0] + observer.offset + 3.0
    observer.correct(Measurement(seen, None, None, tick, "converged"), robot().rest_e)
    assert observer.astray


def sample_after(observer, there, u, spoil=lambda x: x):
    """One tick under u with a sample that is spoilt; what became of it."""
    observer.command(u)
    found = there.step(u, "force")
    return observer.correct(Measurement(spoil(found.x_e), None, None, found.t, "converged"), robot().rest_e)


def settled(ticks=60, **body):
    at, there = clocked(), plant(2.4, noise=NOISE, **body)
    observer = Observer(at, at.at_rest(standing(2.4)), np.ones(3), Doubt(noise=NOISE))
    for k in range(ticks):
        sample_after(observer, there, swinging(k))
    return observer, there


def swinging(k):
    return np.array([2.4 * (1 + 0.3 * np.sin(0.25 * k) * min(k / 30, 1.0))])


@pytest.mark.parametrize("away", [5.0, 50.0, 1e3, 1e6])
def test_one_outlier_changes_nothing(away):
    (observer, there), (clean, other) = settled(), settled()
    assert sample_after(observer, there, swinging(60), lambda x: x + [0.0, away, 0.0]) is SampleVerdict.REJECTED
    sample_after(clean, other, swinging(60))
    for k in range(61, 81):
        assert (
            sample_after(observer, there, swinging(k))
            is sample_after(clean, other, swinging(k))
            is SampleVerdict.ACCEPTED
        )
    np.testing.assert_allclose(observer.state.z, clean.state.z, atol=0.01)
    np.testing.assert_allclose(observer.offset, clean.offset, atol=0.01)


def test_a_robot_that_is_stiffer_and_swings_is_not_rejected():
    for stiffness in (0.9, 1.1, 1.3):
        observer, there = settled(0, stiffness=stiffness, viscosity=1.3)
        assert all(sample_after(observer, there, swinging(k)) is SampleVerdict.ACCEPTED for k in range(120))


def test_a_robot_that_is_elsewhere_is_believed_after_so_many_samples():
    """Pushed away by 20 mm: the observer begins again after 8 samples that agree, and knows where it is at once."""
    observer, there = settled()
    said = [sample_after(observer, there, swinging(k), lambda x: x + [0.0, 15.0, -12.0]) for k in range(60, 90)]
    assert said == [SampleVerdict.REJECTED] * 7 + [SampleVerdict.RESTART] + [SampleVerdict.ACCEPTED] * 22
    e, _ = clocked().effectors(observer.now().z[None])
    expected = robot().rest_e + e[0] + observer.offset
    assert np.linalg.norm(expected - there.actual.x_e - [0.0, 15.0, -12.0]) < 4 * NOISE


def test_a_sensor_that_is_stuck_is_rejected_and_a_robot_that_stands_still_is_not():
    observer, there = settled()
    frozen = there.actual.x_e.copy()
    said = [sample_after(observer, there, swinging(k), lambda x: frozen) for k in range(60, 80)]
    assert said.count(SampleVerdict.REJECTED) >= 15 and SampleVerdict.RESTART not in said
    observer, there = settled()
    said = [
        sample_after(observer, there, np.array([2.4]), lambda x: robot().rest_e + standing(2.4).delta_e)
        for _ in range(40)
    ]
    assert said[20:] == [SampleVerdict.ACCEPTED] * 20


def test_an_estimate_that_is_lost_begins_again_at_the_model_s_equilibrium():
    observer, there = settled()
    observer.state.z[:] = np.nan
    assert sample_after(observer, there, np.array([2.0])) is SampleVerdict.RESTART
    observer.restart(np.array([2.0]))
    np.testing.assert_allclose(observer.state.z[:1], standing(2.0).delta_a, rtol=1e-8)
    assert not observer.state.z[1:].any() and not observer.offset.any() and observer.material.stiffness == 1.0
    observer.restart(np.array([1e9]))  # no such equilibrium
    assert np.isfinite(observer.state.z).all()


def test_what_samples_miss_widens_the_offset_and_a_swing_of_a_share_of_it():
    """By forces all free motions have the same energy, potential and kinetic; of the effectors' coordinates the mean
    square is that share, and nothing else becomes wider."""
    observer, _ = settled(20)
    square, n_q, share = 0.25, robot().n_q, 0.1
    before, wider = observer.covariance, observer._widened(square)
    np.testing.assert_array_equal(wider.mean, observer._known.mean)
    more = wider.covariance - before
    place, every = observer._clocked.warped(observer._place), np.arange(len(more))
    places, momenta, offsets = every[:n_q], every[n_q : 2 * n_q], every[observer._offsets]
    energies = [
        np.linalg.eigvals(more[np.ix_(places, places)] @ place.K[0]).real,
        np.linalg.eigvals(more[np.ix_(momenta, momenta)] @ np.linalg.inv(place.M[0])).real,
    ]
    for energy in energies:
        np.testing.assert_allclose(energy, energies[0][0], rtol=1e-6)
    J = np.concatenate([place.J[0], place.H[0]], axis=1)
    assert np.trace(J @ more[np.ix_(places, places)] @ J.T) / len(J) == pytest.approx(share * square)
    np.testing.assert_allclose(more[np.ix_(offsets, offsets)], square * np.eye(3), atol=1e-12)
    for own in (places, momenta, offsets):
        more[np.ix_(own, own)] = 0.0
    assert np.abs(more).max() < 1e-12 * np.abs(before).max()
