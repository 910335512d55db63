"""The steps of a Kalman filter: against conditioning of normal distributions and general least squares."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares

from cfem.predict.estimation.fit import Search
from cfem.predict.estimation.gate import Gate, SampleVerdict
from cfem.predict.estimation.kalman import Gaussian, gated_update, information_root

RNG = np.random.default_rng(0)
ROOT = RNG.normal(size=(5, 5)) * [1.0, 10.0, 0.01, 3.0, 1e-3]
PRIOR = Gaussian(RNG.normal(size=5), ROOT.T @ ROOT)
H = RNG.normal(size=(3, 5)) / np.sqrt(np.diag(PRIOR.covariance))
R = np.diag([0.1, 0.4, 0.2])
SAMPLE = np.array([0.7, -1.1, 0.4])
EVERYWHERE = np.array([[-np.inf, np.inf]] * 5)
SEARCH = Search(np.sqrt(np.diag(PRIOR.covariance)), EVERYWHERE, 1e-12, 50)


def conditioned(joint_mean, joint, known, values):
    """Mean and covariance of the other numbers of a normal distribution where some are known."""
    others = np.setdiff1d(np.arange(len(joint)), known)
    precision = np.linalg.inv(joint)[np.ix_(others, others)]
    covariance = np.linalg.inv(precision)
    across = np.linalg.inv(joint)[np.ix_(others, known)]
    return joint_mean[others] - covariance @ across @ (values - joint_mean[known]), covariance


def test_a_prediction_is_the_distribution_of_what_moves():
    """Against the mean and covariance of many draws."""
    rng, F, Q = np.random.default_rng(1), np.array([[1.0, 0.5], [0.0, 0.9]]), np.diag([0.1, 0.02])
    prior = Gaussian(np.array([1.0, -2.0]), np.array([[0.5, 0.2], [0.2, 0.3]]))
    draws = rng.multivariate_normal(prior.mean, prior.covariance, 200_000) @ F.T
    draws += rng.multivariate_normal(np.zeros(2), Q, len(draws))
    predicted = prior.predicted(F @ prior.mean, F, Q)
    np.testing.assert_allclose(predicted.mean, draws.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(predicted.covariance, np.cov(draws.T), atol=0.01)


def test_an_update_conditions_the_joint_distribution_of_state_and_sample():
    P = PRIOR.covariance
    joint = np.block([[P, P @ H.T], [H @ P, H @ P @ H.T + R]])
    mean, covariance = conditioned(np.r_[PRIOR.mean, H @ PRIOR.mean], joint, np.arange(5, 8), SAMPLE)
    update = PRIOR.updated(H, SAMPLE - H @ PRIOR.mean, R)
    size = np.sqrt(np.diag(P))
    np.testing.assert_allclose(update.posterior.mean / size, mean / size, rtol=1e-6)
    np.testing.assert_allclose(update.posterior.covariance / np.outer(size, size), covariance / np.outer(size, size),
                               atol=1e-7)  # fmt: skip


def test_its_square_is_the_least_sum_of_squares():
    weight = np.linalg.inv(np.linalg.cholesky(R))
    root = information_root(PRIOR.covariance)
    solved = least_squares(
        lambda z: np.r_[root @ (z * SEARCH.scale), weight @ (SAMPLE - H @ (PRIOR.mean + z * SEARCH.scale))], np.zeros(5)
    )
    update = PRIOR.updated(H, SAMPLE - H @ PRIOR.mean, R)
    assert update.innovation == (pytest.approx(2 * solved.cost, rel=1e-6), 3)


def test_squares_of_samples_drawn_as_assumed_are_chi_squared():
    rng, squares = np.random.default_rng(2), []
    S = H @ PRIOR.covariance @ H.T + R
    for missed in rng.multivariate_normal(np.zeros(3), S, 4000):
        squares.append(PRIOR.updated(H, missed, R).square)
    assert np.mean(squares) == pytest.approx(3, abs=0.15) and np.var(squares) == pytest.approx(6, abs=0.8)


def test_a_state_without_uncertainty_stays():
    """The covariance is singular: numbers that are known exactly do not change, the others do as without them."""
    P = PRIOR.covariance.copy()
    P[1], P[:, 1] = 0.0, 0.0
    update = Gaussian(PRIOR.mean, P).updated(H, SAMPLE, R)
    rest = [0, 2, 3, 4]
    without = Gaussian(PRIOR.mean[rest], P[np.ix_(rest, rest)]).updated(H[:, rest], SAMPLE, R)
    assert update.posterior.mean[1] == PRIOR.mean[1] and not update.posterior.covariance[1].any()
    np.testing.assert_allclose(update.posterior.mean[rest], without.posterior.mean, rtol=1e-12)
    assert update.square == pytest.approx(without.square, rel=1e-12)


def test_a_covariance_that_is_none_says_that_the_filter_is_lost():
    update = Gaussian(np.zeros(1), np.array([[-5.0]])).updated(np.eye(1), np.ones(1), np.eye(1))
    assert update.innovation == (-np.inf, 1)
    assert Gate().judge(*update.innovation) is SampleVerdict.RESTART
    exact = Gaussian(np.zeros(1), np.eye(1)).updated(np.eye(1), np.zeros(1), np.eye(1))
    assert exact.innovation == (0.0, 1)


def test_iterations_on_linear_rows_are_the_update():
    once = PRIOR.updated(H, SAMPLE - H @ PRIOR.mean, R)
    many = PRIOR.iterated(SAMPLE, lambda x: H @ x, lambda x: H, R, SEARCH)
    np.testing.assert_allclose(many.posterior.mean, once.posterior.mean, rtol=1e-9)
    np.testing.assert_allclose(many.posterior.covariance, once.posterior.covariance, rtol=1e-6, atol=1e-12)
    assert many.square == pytest.approx(once.square, rel=1e-6)


def test_iterations_on_bent_rows_end_at_the_least_squares():
    """Against a general solver; one step alone ends elsewhere."""
    prior, search = (
        Gaussian(np.array([1.0, 0.5]), np.diag([0.3, 0.2])),
        Search(np.ones(2), EVERYWHERE[:2], 1e-12, 60),
    )

    def h(x):
        return np.array([x[0] * np.exp(0.4 * x[1]), x[1] + 0.2 * x[0] ** 2])

    def slope(x):
        return np.array([[np.exp(0.4 * x[1]), 0.4 * x[0] * np.exp(0.4 * x[1])], [0.4 * x[0], 1.0]])

    noise, sample = 0.05 * np.eye(2), np.array([1.9, 1.3])
    deviations = np.sqrt(np.diag(prior.covariance))
    solved = least_squares(
        lambda x: np.r_[(x - prior.mean) / deviations, (sample - h(x)) / np.sqrt(0.05)], prior.mean, xtol=1e-14
    )
    update = prior.iterated(sample, h, slope, noise, search)
    np.testing.assert_allclose(update.posterior.mean, solved.x, rtol=1e-7)
    assert update.square == pytest.approx(2 * solved.cost, rel=1e-7)
    np.testing.assert_allclose(update.posterior.covariance, np.linalg.inv(solved.jac.T @ solved.jac), rtol=1e-4)
    single = prior.iterated(sample, h, slope, noise, Search(np.ones(2), EVERYWHERE[:2], 1e-12, 1))
    assert np.abs(single.posterior.mean - solved.x).max() > 1e-3
    box = np.array([[0.9, 1.1], [0.4, 0.6]])
    bounded = prior.iterated(sample, h, slope, noise, Search(np.ones(2), box, 1e-12, 60))
    assert (bounded.posterior.mean >= box[:, 0]).all() and (bounded.posterior.mean <= box[:, 1]).all()


def test_iterations_end_at_the_tolerance():
    asked = []

    def expected(x):
        asked.append(x)
        return H @ x

    loose = Search(SEARCH.scale, EVERYWHERE, 1e9, 50)
    PRIOR.iterated(SAMPLE, expected, lambda x: H, R, loose)
    assert len(asked) == 2


def test_the_rest_follows_a_part_as_in_an_update_of_all():
    """Rows that show two of five numbers: their update, completed, is that of the whole state."""
    part = np.array([1, 3])
    shown = np.zeros((3, 5))
    shown[:, part] = H[:, part]
    whole = PRIOR.updated(shown, SAMPLE, R).posterior
    known = Gaussian(PRIOR.mean[part], PRIOR.covariance[np.ix_(part, part)])
    completed = PRIOR.with_part(part, known.updated(H[:, part], SAMPLE, R).posterior)
    size = np.sqrt(np.diag(PRIOR.covariance))
    np.testing.assert_allclose(completed.mean / size, whole.mean / size, rtol=1e-7)
    np.testing.assert_allclose(completed.covariance / np.outer(size, size), whole.covariance / np.outer(size, size),
                               atol=1e-8)  # fmt: skip


def test_a_prior_s_residuals_have_unit_covariance_whatever_the_units():
    root = PRIOR.prior.root
    np.testing.assert_allclose(root @ PRIOR.covariance @ root.T, np.eye(5), atol=1e-6)
    units = np.diag([1e6, 1e-6, 1.0, 1e3, 1e-3])
    np.testing.assert_allclose(information_root(units @ PRIOR.covariance @ units) @ units, root, rtol=1e-6)


@dataclass(frozen=True)
class Answer:
    """A correction by hand."""

    began_with: str
    innovation: tuple[float, int]


def ask(gate, predicted, square):
    return gated_update(gate, predicted, lambda: "first", lambda prior: Answer(prior, (square, 3)))


def test_without_a_prediction_the_filter_begins_and_the_sample_is_not_judged():
    gate = Gate()
    gate.spread = 3.0
    answer, verdict = ask(gate, None, 1e9)
    assert answer.began_with == "first" and verdict is SampleVerdict.ACCEPTED and gate.spread == gate.first


def test_samples_are_judged_and_after_a_run_the_filter_begins_again():
    gate = Gate(samples=3, first=1.0)
    assert ask(gate, "predicted", 2.0) == (Answer("predicted", (2.0, 3)), SampleVerdict.ACCEPTED)
    answers = [ask(gate, "predicted", 1e6) for _ in range(3)]
    assert [verdict for _, verdict in answers] == [
        SampleVerdict.REJECTED,
        SampleVerdict.REJECTED,
        SampleVerdict.RESTART,
    ]
    assert [answer.began_with for answer, _ in answers] == ["predicted", "predicted", "first"]
    assert gate.spread == 1.0 and gate.agreeing == 0
