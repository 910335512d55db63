"""The energy model learns a robot of closed form: to rounding, with exact identities, from training rows alone."""

import numpy as np
import pytest
from surrogate.synthetic import dataset

from cfem.predict.load import build
from cfem.predict.spectral import SpectralPredictor
from cfem.surrogate.error_measures import measure
from cfem.surrogate.model_card import model_card
from cfem.surrogate.spectral import Observations, fit, fit_quantity, nested_least_squares


def predictor_of(training) -> SpectralPredictor:
    return build(model_card("spectral", training), fit(training).arrays)


def loss(training, test) -> float:
    return measure(test, *predictor_of(training).evaluate(test.delta_a))["loss"]


@pytest.mark.parametrize(
    ("n_a", "unilateral", "bound"),
    [(1, True, 1e-20), (2, True, 1e-15), (2, False, 1e-15), (3, False, 1e-10), (4, False, 1e-7)],
)
def test_it_learns_the_robot_from_a_hundred_states(n_a, unilateral, bound):
    assert loss(dataset(100, 1, n_a, unilateral), dataset(100, 2, n_a, unilateral)) < bound


def test_convergence_is_spectral():
    """A method of algebraic order 6 would gain 2^6 in error, 2^12 in its square, from twice the states."""
    test = dataset(100, 2)
    coarse, fine = (loss(dataset(m, 1), test) for m in (20, 40))
    assert fine < coarse / 2**12


def test_the_papers_loss_is_passed_with_thirty_states():
    assert loss(dataset(30, 1), dataset(200, 2)) < 3.79e-6


@pytest.mark.parametrize("n_a", [1, 2, 3])
def test_derivatives_in_the_series_are_those_of_its_energy(n_a):
    training = dataset(60, 1, n_a, unilateral=False)
    predictor = predictor_of(training)
    states, h = training.delta_a[:8], 1e-4
    part = predictor.parts(states)
    for i in range(n_a):
        step = h * np.eye(n_a)[i]
        ahead, behind = predictor.parts(states + step), predictor.parts(states - step)

        def slope(name, ahead=ahead, behind=behind):
            return (ahead[name] - behind[name]) / (2 * h)

        assert np.allclose(slope("energy")[:, 0], part["gradient"][:, i], atol=1e-6)
        assert np.allclose(slope("gradient"), part["hessian"][:, i], atol=1e-6)
        assert np.allclose(slope("effector"), part["effector_gradient"][..., i], atol=1e-6)


def test_identities_hold_whatever_the_fit():
    training = dataset(12, 1)  # too few states for a good fit: the identities are not learned, they are built in
    predictor = predictor_of(training)
    for delta_a in dataset(20, 3).delta_a:
        condensed = predictor.at_displacement(delta_a)
        part = predictor.parts(delta_a)
        assert np.allclose(condensed.W, condensed.W.T, rtol=0, atol=1e-13 * np.abs(condensed.W).max())
        assert np.allclose(condensed.W_aa @ part["hessian"], np.eye(2), atol=1e-12)
        assert np.allclose(condensed.delta_a, delta_a, atol=1e-12)
        assert np.allclose(condensed.delta_e, part["effector"], atol=1e-11)
        assert np.allclose(condensed.effector_jacobian, part["effector_gradient"], atol=1e-11)


def test_the_fit_does_not_depend_on_the_unit_of_an_actuator():
    """Displacements in another unit (shorter by 1000, forces longer) give the same tip."""
    training, test = dataset(40, 1), dataset(20, 2)
    scaled = dataset(40, 1)
    a, e = scaled.rows.a, scaled.rows.e
    scaled.delta_a, scaled.lambda_a = training.delta_a / 1000, training.lambda_a * 1000
    scaled.W[:, e, a] /= 1e3
    scaled.W[:, a, e] /= 1e3
    scaled.W[:, a, a] /= 1e6
    one = predictor_of(training).parts(test.delta_a)["effector"]
    other = predictor_of(scaled).parts(test.delta_a / 1000)["effector"]
    assert np.allclose(one, other, atol=1e-7)


def test_degrees_stay_within_the_rows():
    for m in (4, 7, 12):
        found = fit(dataset(m, 1))
        rows = {"energy": 6, "effector": 3, "locked_compliance": 1}
        for record in found.held_out:
            assert record["terms"] <= max(1, 0.7 * m * rows[record["quantity"]])
            assert np.isfinite(record["error"])


def test_held_out_error_finds_the_degree_of_a_polynomial_in_noise():
    rng = np.random.default_rng(0)
    z = rng.uniform(-1, 1, (60, 2))
    values = z[:, 0] ** 3 * z[:, 1] + z[:, 1] ** 2 + 1e-6 * rng.normal(size=60)
    errors, _ = fit_quantity(z, Observations((values[:, None, None],)), 8, 5)
    assert np.argmin(errors) == 4
    assert errors[4] < 1e-5 < errors[3]


def test_nested_least_squares_are_separate_least_squares():
    rng = np.random.default_rng(2)
    design, targets = rng.normal(size=(10, 3, 8)), rng.normal(size=(10, 3, 2))
    for count, solution in zip((1, 5, 8), nested_least_squares(design, targets, [1, 5, 8]), strict=True):
        direct = np.linalg.lstsq(design.reshape(30, 8)[:, :count], targets.reshape(30, 2))[0]
        assert np.allclose(solution, direct, atol=1e-12)
