"""The energy model learns a robot of closed form: to rounding, with exact identities, from training rows alone."""

from dataclasses import replace

import numpy as np
import pytest
from support.fast_cases import fast_are
from surrogate.synthetic import dataset

from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.load import build
from cfem.surrogate.error_measures import measure
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.chebyshev import design_rows, index_set
from cfem.surrogate.series.observations import Observations
from cfem.surrogate.series.spectral import Series, _values_first, fit, fit_quantity
from cfem.surrogate.stage import predictions

NONE = np.zeros((20, 0))


def predictor_of(training, form="displacement") -> SpectralPredictor:
    return build(model_card("spectral", training, form), fit(training, form).arrays)


def loss(training, test, form="displacement") -> float:
    return measure(test, *predictions(predictor_of(training, form), test))["loss"]


@pytest.mark.parametrize(
    ("n_a", "unilateral", "bound"),
    [
        (1, True, 1e-20),
        (2, True, 1e-15),
        (2, False, 1e-15),
        pytest.param(3, False, 1e-10, marks=pytest.mark.slow),
        pytest.param(4, False, 1e-7, marks=pytest.mark.slow),
    ],
)
def test_it_learns_the_robot_from_a_hundred_states(n_a, unilateral, bound):
    assert loss(dataset(100, 1, n_a, unilateral), dataset(100, 2, n_a, unilateral)) < bound


@pytest.mark.parametrize(("n_a", "bound"), [(1, 1e-15), (2, 1e-8)])
def test_so_does_the_dual(n_a, bound):
    assert loss(dataset(100, 1, n_a), dataset(50, 2, n_a), "force") < bound


@pytest.mark.parametrize(
    ("n_a", "form"),
    fast_are(
        [(2, "displacement"), (2, "force")],
        [(2, "displacement"), (3, "displacement"), (4, "displacement"), (2, "force")],
    ),
)
def test_third_order_gains(n_a, form):
    """From few states, where each counts."""
    test = dataset(50, 2, n_a, n_a == 2)
    with_it, without = (loss(dataset(20, 1, n_a, n_a == 2, third), test, form) for third in (True, False))
    assert with_it < without / 5


def test_a_parameter_is_one_more_input():
    assert loss(dataset(100, 1, parameters=True), dataset(50, 2, parameters=True)) < 1e-7


def test_convergence_is_spectral():
    """A method of algebraic order 6 would gain 2^6 in error, 2^12 in its square, from twice the states."""
    test = dataset(100, 2)
    coarse, fine = (loss(dataset(m, 1), test) for m in (20, 40))
    assert fine < coarse / 2**12


def test_the_papers_loss_is_passed_with_thirty_states():
    assert loss(dataset(30, 1), dataset(200, 2)) < 3.79e-6


@pytest.mark.parametrize("n_a", fast_are({1, 2}, [1, 2, 3]))
def test_derivatives_in_the_series_are_those_of_its_energy(n_a):
    training = dataset(60, 1, n_a, unilateral=False)
    predictor = predictor_of(training)
    states, h = training.delta_a[:20], 1e-4
    part = predictor.parts(states, NONE)
    for i in range(n_a):
        step = h * np.eye(n_a)[i]
        ahead, behind = predictor.parts(states + step, NONE), predictor.parts(states - step, NONE)

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
        part = predictor.parts(delta_a, NONE[0])
        assert np.allclose(condensed.W, condensed.W.T, rtol=0, atol=1e-13 * np.abs(condensed.W).max())
        assert np.allclose(condensed.W_aa @ part["hessian"], np.eye(2), atol=1e-12)
        assert np.allclose(condensed.delta_a, delta_a, atol=1e-12)
        assert np.allclose(condensed.delta_e, part["effector"], atol=1e-11)
        assert np.allclose(condensed.effector_jacobian, part["effector_gradient"], atol=1e-11)


def test_the_fit_does_not_depend_on_the_unit_of_an_actuator():
    """Displacements in another unit (shorter by 1000, forces longer) give the same tip."""
    training, test = dataset(40, 1), dataset(20, 2)
    e, a, W = training.rows.e, training.rows.a, training.W.copy()
    W[:, e, a] /= 1e3
    W[:, a, e] /= 1e3
    W[:, a, a] /= 1e6
    scaled = replace(training, delta_a=training.delta_a / 1000, lambda_a=training.lambda_a * 1000, W=W)
    one = predictor_of(training).parts(test.delta_a, NONE)["effector"]
    other = predictor_of(scaled).parts(test.delta_a / 1000, NONE)["effector"]
    assert np.allclose(one, other, atol=1e-7)


def test_degrees_stay_within_the_rows():
    for m in (4, 7, 12):
        found = fit(dataset(m, 1))
        rows = {"potential": 6, "effector": 3, "effector_compliance": 1}
        for record in found.held_out:
            assert record["terms"] <= max(1, 0.9 * m * rows[record["quantity"]])
            assert np.isfinite(record["error"])


def test_held_out_error_finds_the_degree_of_a_polynomial_in_noise():
    rng = np.random.default_rng(0)
    z = rng.uniform(-1, 1, (60, 2))
    values = z[:, 0] ** 3 * z[:, 1] + z[:, 1] ** 2 + 1e-6 * rng.normal(size=60)
    _, _, records = fit_quantity(z, Observations(((),), values[:, None, None], 2), 8, 2000, 5)
    errors = {record["degree"]: record["error"] for record in records if record["weights"] == "equal"}
    assert min(errors, key=errors.get) == 4
    assert errors[4] < 1e-5 < errors[3]


def test_weights_follow_what_matters():
    """A function that bends along one coordinate and is straight along another."""
    rng = np.random.default_rng(0)
    z = rng.uniform(-1, 1, (300, 3))
    values = np.sin(4 * z[:, 0]) * (1 + 0.1 * z[:, 1]) + 0.05 * np.cos(z[:, 2])
    chosen, weights, _ = fit_quantity(z, Observations(((),), values[:, None, None], 3), 16, 2000, 5)
    assert weights[0] == 1.0 and weights[1] > 1.5 and weights[2] > 1.2
    isotropic = Series(index_set(np.ones(3), 2000, 16)[0], np.zeros((1, 1)))
    assert len(chosen.indices) < len(isotropic.indices) and chosen.indices[:, 0].max() > chosen.indices[:, 1].max()


def test_whole_degrees_go_on_while_they_help(monkeypatch):
    """The first whole degrees that are tried are too low, and no weights are better than equal ones."""
    monkeypatch.setattr("cfem.surrogate.series.spectral.PILOT_TERMS", 20)  # degree 3
    for name in ("searched_weights", "decay_weights"):
        monkeypatch.setattr(f"cfem.surrogate.series.spectral.{name}", lambda *_: np.ones(3))
    rng = np.random.default_rng(0)
    z = rng.uniform(-1, 1, (150, 3))
    values = np.sin(2.0 * z.sum(axis=1)) + np.cos(1.7 * (z @ [1.0, -1.0, 1.0]))
    chosen, weights, records = fit_quantity(z, Observations(((),), values[:, None, None], 3), 9, 130, 5)
    equal = [record["terms"] for record in records if record["weights"] == "equal"]
    assert equal[:6] == [1, 4, 10, 20, 35, 56] and len(chosen.indices) == equal[-1] and np.allclose(weights, 1.0)
    *_, few = fit_quantity(z, Observations(((),), values[:, None, None], 3), 9, 50, 5)
    assert max(record["terms"] for record in few if record["weights"] == "equal") == 35


def test_terms_stay_within_their_number():
    found = fit(dataset(40, 1, 3, unilateral=False), max_terms=30)
    assert max(found.terms.values()) <= 30


PAIRS = [(i, j) for i in range(4) for j in range(i, 4)]


def observed_ridges(z: np.ndarray, ridges: np.ndarray, jet) -> Observations:
    """Value, gradient and Hessian of the sum of a function over ridges (k, 4); jet: its value, slope and curvature."""
    value, slope, curvature = jet(z @ ridges.T)
    columns = [value.sum(axis=1)]
    columns += [slope @ ridges[:, i] for i in range(4)] + [curvature @ (ridges[:, i] * ridges[:, j]) for i, j in PAIRS]
    return Observations(((), *[(i,) for i in range(4)], *PAIRS), np.stack(columns, axis=1)[..., None], 4)


def fold(u):
    root = np.sqrt(1.4 - u)
    return root, -1 / (2 * root), -1 / (4 * root**3)


def step(u):
    t = np.tanh(2 * u)
    return t, 2 * (1 - t**2), -8 * t * (1 - t**2)


@pytest.mark.parametrize(("jet", "first"), fast_are([(fold, True)], [(fold, True), (step, False)]))
def test_values_come_first_only_where_states_left_out_say_so(jet, first):
    """Four inputs and 40 states. A series is too short to follow the second derivatives, near the limit of one ridge
    and of steps across six."""
    random = np.random.default_rng(3)
    ridges = random.standard_normal((6, 4))
    ridges = np.array([[0.4, 0.35, 0.3, 0.3]]) if first else ridges / np.linalg.norm(ridges, axis=1)[:, None]
    z, fresh = random.uniform(-1, 1, (40, 4)), random.uniform(-1, 1, (300, 4))
    observed, truth = observed_ridges(z, ridges, jet), observed_ridges(fresh, ridges, jet).values[:, 0]
    limits = (16, 2000, 5, None)
    made = [fit_quantity(z, observed, *limits, fall=fall) for fall in (1.0, 10.0)]
    errors = [
        np.sqrt(((design_rows(fresh, each.indices, ((),))[:, 0] @ each.coefficients - truth) ** 2).mean())
        for each, _, _ in made
    ]
    chosen, _, _ = _values_first(z, observed, made[0], limits)
    np.testing.assert_array_equal(chosen.coefficients, made[int(first)][0].coefficients)
    assert (errors[1] < 0.9 * errors[0]) == first, errors
