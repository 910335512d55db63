"""The least-squares problem of an estimate: against general solvers, and by its own optimality."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from cfem.predict.estimation.fit import (
    FIT,
    TOLERANCE,
    EstimateStatus,
    FitResiduals,
    Markers,
    Prior,
    Search,
    Sensor,
    minimise,
)

RNG = np.random.default_rng(0)
PLACES = RNG.normal(size=(6, 3))
TURNS = RNG.normal(size=(6, 3, 2))
NO_PRIOR = Prior(np.zeros(2), np.zeros((0, 2)))
SEARCH = Search(np.ones(2), np.array([[-5.0, 5.0]] * 2))
BEND = 0.15


def places(x, bend=BEND):
    """Markers (6, 3) on a body that bends, and their slopes (6, 3, 2)."""
    return (
        PLACES + TURNS @ x + bend * (TURNS @ x) ** 3,
        TURNS + 3 * bend * ((TURNS @ x) ** 2)[..., None] * TURNS,
    )


def problem(measured, seen=None, prior=NO_PRIOR, sensors=(), noise=0.1, bend=BEND):
    def residual(x):
        value, slope = places(x, bend)
        return (value - np.nan_to_num(measured)) / noise, slope / noise

    return FitResiduals(Markers(residual, np.isfinite(measured).all(axis=1) if seen is None else seen), prior, sensors)


def solve(asked, x=(0.0, 0.0), search=SEARCH, elsewhere=(0.0, 0.0)):
    return minimise(asked, np.array(x), search, lambda: np.array(elsewhere))


def noisy(x, seed=1, noise=0.1):
    return places(np.array(x))[0] + noise * np.random.default_rng(seed).normal(size=(6, 3))


def test_it_ends_where_a_general_solver_does():
    """Markers, a sensor of the first unknown and a prior of the second, each weighed by its deviation."""
    measured = noisy([0.8, -0.5])
    sensor = Sensor(lambda x: (x[:1], np.eye(1, 2)), np.array([0.9]), 0.05, np.array([True]))
    prior = Prior(np.array([0.0, -0.3]), np.array([[0.0, 1 / 0.02]]))
    found = solve(problem(measured, prior=prior, sensors=(sensor,)))
    solved = least_squares(
        lambda x: np.r_[((places(x)[0] - measured) / 0.1).ravel(), (x[0] - 0.9) / 0.05, (x[1] + 0.3) / 0.02],
        [0.0, 0.0],
        xtol=1e-14,
        ftol=1e-14,
    )
    assert found.converged and not found.outliers
    np.testing.assert_allclose(found.x, solved.x, atol=TOLERANCE)
    assert found.misfit == (pytest.approx(2 * solved.cost, rel=1e-6), 18)
    np.testing.assert_allclose(found.covariance(SEARCH.scale), np.linalg.inv(solved.jac.T @ solved.jac), rtol=1e-4)


def gauss_newton(asked, x, kept):
    """Steps until the next would be below the tolerance by the rate at which they shrink."""
    count, before = 0, np.inf
    while True:
        point = asked(x, kept)
        step = -np.linalg.lstsq(point.J, point.r, rcond=None)[0]
        x, count, size = x + step, count + 1, np.abs(step).max()
        if size * (min(size / before, 1.0) if count > 1 else 1.0) <= TOLERANCE:
            return x, count
        before = size


@pytest.mark.parametrize("truth", [(0.1, 0.05), (0.8, -0.5), (1.2, 0.9)])
def test_steps_are_gauss_and_newton_s_and_end_at_the_tolerance(truth):
    """As many as those of undamped steps, and what is left of the next is below the tolerance."""
    asked = problem(noisy(truth))
    found = solve(asked, np.array(truth) + 0.05)
    x, count = gauss_newton(asked, np.array(truth) + 0.05, np.ones(6, dtype=bool))
    assert found.iterations == count and found.converged
    np.testing.assert_allclose(found.x, x, atol=1e-8)
    left = np.linalg.lstsq(found.J, found.r, rcond=None)[0]
    assert np.abs(left).max() < TOLERANCE


@pytest.mark.parametrize(("distance", "steps"), [(0.7, 1), (1.5, 2)])
def test_a_first_step_below_the_tolerance_is_the_last(distance, steps):
    """From so many tolerances beside the minimum of rows that are straight."""
    minimum = solve(problem(noisy([0.3, 0.2]), bend=0.0)).x
    found = solve(problem(noisy([0.3, 0.2]), bend=0.0), minimum + [distance * TOLERANCE, 0.0])
    assert found.iterations == steps


def test_steps_that_are_too_long_are_damped():
    """From far away, where undamped steps overshoot: it ends at the same minimum."""
    measured = noisy([1.5, -1.0], noise=0.0)
    found = solve(problem(measured, bend=1.0), (0.0, 0.0))
    asked = problem(places(np.array([1.5, -1.0]), 1.0)[0], bend=1.0)
    assert not found.outliers or found.converged
    far = solve(asked, (-1.5, 1.5), elsewhere=(1.4, -0.9))
    assert far.converged
    np.testing.assert_allclose(far.x, [1.5, -1.0], atol=1e-6)


def test_iterations_that_do_not_suffice_are_said():
    """A sensor that bends, without markers, of which one could be wrong."""
    sensor = Sensor(lambda x: (x + x**3, np.diag(1 + 3 * x**2)), np.array([0.9, 0.4]), 0.05, np.ones(2, dtype=bool))
    asked = problem(np.full((6, 3), np.nan), sensors=(sensor,))
    found = solve(asked, search=Search(SEARCH.scale, SEARCH.box, iterations=1))
    assert found.status is EstimateStatus.ITERATIONS and found.iterations == 1 and not found.converged
    assert found.innovation == (np.inf, 1)
    assert solve(asked).converged


def test_the_minimum_stays_in_its_box():
    found = solve(problem(noisy([0.8, -0.5]), prior=Prior(np.zeros(2), 1e3 * np.eye(2) / 1e3)),
                  search=Search(SEARCH.scale, np.array([[-5.0, 0.78], [-5.0, 5.0]])))  # fmt: skip
    assert found.x[0] == 0.78


@pytest.mark.parametrize("wrong", [(0,), (2, 5)])
def test_wrong_markers_are_left_out_and_the_rest_is_solved_alone(wrong):
    measured = noisy([0.8, -0.5])
    measured[list(wrong)] += 4.0 * np.random.default_rng(3).normal(size=(len(wrong), 3))
    found = solve(problem(measured))
    assert found.converged and found.outliers == wrong
    missing = measured.copy()
    missing[list(wrong)] = np.nan
    alone = solve(problem(missing))
    assert alone.outliers == () and not alone.kept[list(wrong)].any()
    np.testing.assert_allclose(found.x, alone.x, atol=TOLERANCE)
    assert found.noise == pytest.approx(alone.noise, rel=1e-5)
    assert found.noise == pytest.approx(np.sqrt(np.mean(alone.r**2)), rel=1e-5)


def test_one_marker_just_beyond_the_limit_is_wrong_and_one_within_is_not():
    """Of markers without noise, one alone is off: by its distance over the noise."""
    for share, wrong in ((0.97, ()), (1.2, (4,))):
        measured = np.concatenate([places(np.array([0.3, 0.2]))[0]])
        asked = problem(measured, prior=Prior(np.array([0.3, 0.2]), 1e6 * np.eye(2)))
        measured[4] += share * FIT * 0.1
        assert solve(asked, (0.3, 0.2)).outliers == wrong


def test_where_half_are_wrong_there_is_no_answer():
    measured = noisy([0.8, -0.5])
    measured[:3] += [[30.0, 0, 0], [0, -25.0, 0], [0, 0, 40.0]]
    found = solve(problem(measured))
    assert found.status is EstimateStatus.OUTLIERS and found.innovation == (np.inf, 1)


def test_too_few_numbers_are_said_and_are_nothing_for_the_gate():
    found = solve(problem(np.full((6, 3), np.nan)))
    assert found.status is EstimateStatus.TOO_FEW and found.innovation == (0.0, 0)


def test_what_nothing_measures_has_a_large_deviation():
    sensor = Sensor(lambda x: (x[:1], np.eye(1, 2)), np.array([0.9, 0.1])[:1], 0.05, np.array([True]))
    prior = Prior(np.zeros(2), np.array([[1.0, 0.0]]))
    found = solve(problem(np.full((6, 3), np.nan), prior=prior, sensors=(sensor,)))
    deviation = np.sqrt(np.diag(found.covariance(np.array([1.0, 2.0]), 1e-9)))
    assert deviation[0] == pytest.approx(1 / np.sqrt(1 + 400)) and deviation[1] == pytest.approx(2.0 / np.sqrt(1e-9))


def test_a_sensor_s_numbers_that_are_missing_do_not_count():
    asked = Sensor(lambda x: (x, np.eye(2)), np.array([0.9, np.nan]), 0.5, np.array([True, False]))
    r, J = asked.residual(np.array([1.0, 2.0]))
    np.testing.assert_allclose(r, [0.2])
    np.testing.assert_allclose(J, [[2.0, 0.0]])
