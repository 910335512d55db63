"""The check of definiteness finds what is there."""

import numpy as np
from surrogate.synthetic import dataset

from cfem.predict.load import build
from cfem.surrogate.definiteness import definiteness, random_states, smallest_eigenvalue
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit


def test_scaling_by_units_changes_nothing():
    W = np.array([[[2.0, 1.0], [1.0, 3.0]], [[1.0, 2.0], [2.0, 1.0]]])
    units = np.array([1.0, 1e4])
    assert np.allclose(smallest_eigenvalue(W), smallest_eigenvalue(W * np.outer(units, units)))
    assert smallest_eigenvalue(W)[0] > 0 > smallest_eigenvalue(W)[1]


def test_a_negative_diagonal_is_never_definite():
    assert smallest_eigenvalue(np.array([np.diag([1.0, -1e-9])]))[0] <= -1


def test_random_states_lie_between_the_given_ones():
    s, q = np.random.default_rng(0).uniform(-1, 1, (30, 2)), np.linspace(0, 1, 30)[:, None]
    mixed, mixed_q = random_states(s, q, 1000, 1)
    assert (np.abs(mixed) <= 1).all() and mixed_q.min() >= 0 and mixed_q.max() <= 1
    assert mixed.std(axis=0).min() > 0.2


def test_a_good_model_is_definite_and_a_spoiled_one_is_located():
    for parameters in (False, True):
        training = dataset(80, 1, parameters=parameters)
        found = fit(training)
        card = model_card("spectral", training, form="displacement")
        assert definiteness(build(card, found.arrays), training, 2000)["share"] == 1.0
        spoiled = {**found.arrays, "series": found.arrays["series"].copy()}
        spoiled["series"][3 : 3 + 3] *= -1.0  # hess Psi
        worst = definiteness(build(card, spoiled), training, 500)
        assert worst["share"] == 0.0 and worst["smallest_eigenvalue"] < 0
        assert len(worst["where"]["s"]) == 2 and len(worst["where"]["p"]) == 2 * parameters
