"""Estimates over time: what becomes known, what stays unknown, and whether the intervals hold."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.filter import Filter
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model

TIP = ("tip.x", "tip.y", "tip.z")
NOISE, SENSOR, TENSION, LARGEST = 0.1, 0.05, 0.02, 0.02


@pytest.fixture(scope="module")
def estimator(bar):
    model = load_model(bar / "models" / "bar" / "spectral")
    return Estimator(model, markers_near(model, 5), NOISE, TIP, LARGEST, SENSOR, TENSION)


def measured(estimator, x, rng):
    places = estimator.places(x)
    forces = estimator.tensions(x) + TENSION * rng.normal(size=1)
    return places + NOISE * rng.normal(size=places.shape), x[:1] + SENSOR * rng.normal(size=1), forces


def test_a_push_that_one_frame_does_not_tell_is_known_after_some(estimator):
    x, rng, filtered = np.array([3.0, 0.0, 0.012, -0.008]), np.random.default_rng(0), Filter(estimator, 0.005, 1000)
    deviations = []
    for _ in range(40):
        seen, sensed, forces = measured(estimator, x, rng)
        found = filtered.tick(seen, sensed, x[:1], forces)
        deviations.append(found.deviation)
    first, last = deviations[0], deviations[-1]
    assert (last[2:] < [0.85, 0.5] * first[2:]).all() and found.converged
    assert np.abs(found.loads[1:] - x[2:]).max() < 4 * last[2:].max()


def test_a_push_of_known_direction_is_known_sooner_and_its_intervals_hold(estimator):
    """200 frames of 20 robots: within its intervals, and better than where the direction is not known."""
    along, inside, known, unknown = np.array([0.0, 0.6, 0.8]), [], [], []
    told = replace(estimator, along=along)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = np.concatenate([rng.uniform(2, 5, 1), LARGEST * rng.normal() * along])
        filters = Filter(told, 0.001, 1e5), Filter(estimator, 0.001, 1e5)
        for _ in range(20):
            places, sensed, _ = measured(estimator, x, rng)
            knowing, plain = (one.tick(places, sensed, x[:1]) for one in filters)
        inside.append(abs(along @ (knowing.loads - x[1:])) < 1.96 * np.sqrt(along @ knowing.covariance[1:, 1:] @ along))
        known.append(np.linalg.norm(knowing.loads - x[1:]))
        unknown.append(np.linalg.norm(plain.loads - x[1:]))
        across = np.cross(along, knowing.loads)
        assert np.linalg.norm(across) < 4 * 0.01 * LARGEST
    assert np.mean(inside) >= 0.8 and np.median(known) < 0.6 * np.median(unknown)


def test_a_direction_has_a_number_for_each_load(estimator):
    with pytest.raises(InputError, match="a direction of 3 loads"):
        replace(estimator, along=np.array([1.0, 0.0]))


def test_what_no_marker_sees_stays_as_uncertain_as_at_first(estimator):
    rng, filtered = np.random.default_rng(1), Filter(estimator, 0.005, 20)
    for _ in range(100):
        found = filtered.tick(np.full((5, 3), np.nan), [3.0 + SENSOR * rng.normal()], [3.0])
    assert found.deviation[1:] == pytest.approx(np.full(3, LARGEST), rel=1e-3)
    assert set(TIP) <= set(found.unseen)


def test_intervals_cover(estimator):
    """Loads, slips and noise drawn as the filter assumes: 95 % intervals hold in 93 to 97 % of 1200 numbers."""
    ticks, slip, rho, inside = 30, 0.02, np.exp(-1 / 30), []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        u, w = rng.uniform(1.5, 5.0, 1), LARGEST * rng.normal(size=3)
        delta, filtered = u + 0.3 * rng.normal(size=1), Filter(estimator, slip, ticks, 0.3)
        for frame in range(18):
            if frame:
                step = rng.uniform(-0.1, 0.1, 1)
                u, delta = u + step, delta + step + slip * rng.normal(size=1)
                w = rho * w + np.sqrt(1 - rho**2) * LARGEST * rng.normal(size=3)
            x = np.concatenate([delta, w])
            seen, sensed, forces = measured(estimator, x, rng)
            found = filtered.tick(seen, sensed, u, forces)
            if frame % 3 == 2:
                inside.append(np.abs(np.concatenate([found.delta_a, found.loads]) - x) < 1.96 * found.deviation)
    assert 0.93 < np.mean(inside) < 0.97


def under_forces(estimator, u, x):
    """(n,) unknowns where actuators carry u and the loads of x act: Newton's method on what load cells would show."""
    x = x.copy()
    for _ in range(30):
        shown, by_x = estimator.tension_rows(x)
        change = np.linalg.solve(by_x[:, :1], u - shown)
        x[:1] += change
        if abs(change[0]) < 1e-10:
            return x
    raise AssertionError("no equilibrium")


def test_under_commanded_forces_actuators_yield_as_the_model_does(estimator):
    """To the forces and to loads, against equilibria on either side."""
    x, h = np.array([3.0, 0.0, 0.0, 0.0]), 1e-3
    u, at = estimator.tensions(x), estimator.response(x[:1])
    ahead, behind = (under_forces(estimator, u + sign * h, x)[0] for sign in (1, -1))
    assert at.state.W_aa[0, 0] == pytest.approx((ahead - behind) / (2 * h), rel=1e-4)
    for place in range(3):
        load = h * np.eye(4)[1 + place]
        ahead, behind = (under_forces(estimator, u, x + sign * load)[0] for sign in (1, -1))
        assert at.actuators[0, place] == pytest.approx((ahead - behind) / (2 * h), rel=1e-3, abs=1e-6)


def test_intervals_cover_under_commanded_forces(estimator):
    """Where a push goes shows in where the actuator goes: 95 % intervals hold in 93 to 97 % of 1200 numbers, frames
    miss by what they say, and the push is nearer than by a filter that does not know the forces."""
    ticks, rho, inside, squares, off = 30, np.exp(-1 / 30), [], np.zeros(2), []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x = np.r_[rng.uniform(2.0, 4.0), LARGEST * rng.normal(size=3)]
        u = estimator.tensions(x)
        filters = Filter(estimator, 0.002, ticks, 0.3), Filter(estimator, 0.3, ticks, 0.3)
        for frame in range(15):
            if frame:
                u = u + rng.uniform(-0.03, 0.03, 1)
                x[1:] = rho * x[1:] + np.sqrt(1 - rho**2) * LARGEST * rng.normal(size=3)
            x = under_forces(estimator, u, x)
            places = estimator.places(x) + NOISE * rng.normal(size=(5, 3))
            found = filters[0].tick(places, driven=u)
            deaf = filters[1].tick(places)
            if frame % 3 == 2:
                inside.append(np.abs(np.r_[found.delta_a, found.loads] - x) < 1.96 * found.deviation)
                squares += found.innovation if frame > 2 else (0.0, 0)
        off.append([np.linalg.norm(one.loads[1:] - x[2:]) for one in (found, deaf)])
    assert 0.93 < np.mean(inside) < 0.97
    assert 0.9 < squares[0] / squares[1] < 1.1
    assert np.median(off, axis=0)[0] < 0.9 * np.median(off, axis=0)[1]


def test_it_follows_commands(estimator):
    rng, filtered = np.random.default_rng(3), Filter(estimator, 0.01, 50, 0.1)
    for u in np.linspace(1.0, 5.0, 9):
        x = np.array([u, 0.0, 0.0, 0.0])
        found = filtered.tick(measured(estimator, x, rng)[0], None, [u])
        assert abs(found.delta_a[0] - u) < 0.1


def test_an_outlier_is_left_out_and_a_lost_frame_is_bridged(estimator):
    x, rng, filtered = np.array([3.0, 0.0, 0.01, 0.0]), np.random.default_rng(4), Filter(estimator, 0.005, 200)
    for frame in range(10):
        seen, sensed, _ = measured(estimator, x, rng)
        if frame == 5:
            seen[2] += 9.0
        if frame == 6:
            seen[:] = np.nan
        found = filtered.tick(seen, sensed, x[:1])
        assert found.converged
        assert found.outliers == ((2,) if frame == 5 else ())
    assert abs(found.delta_a[0] - 3.0) < 0.1


@pytest.mark.parametrize("wrong", [{"slip": 0.0, "ticks": 5}, {"slip": 0.1, "ticks": 0}])
def test_what_is_not_positive_is_refused(estimator, wrong):
    with pytest.raises(InputError, match="must be positive"):
        Filter(estimator, **wrong)
