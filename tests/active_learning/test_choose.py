"""The batch goes where the committee differs, and does not crowd."""

import numpy as np
from surrogate.synthetic import dataset

from cfem.active_learning.choose import choose, disagreement
from cfem.predict.load import build
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit

RNG = np.random.default_rng(0)


def test_the_highest_score_comes_first_and_equal_neighbours_are_left():
    u = np.array([[0.1, 0.1], [0.11, 0.1], [0.9, 0.9], [0.5, 0.1]])
    assert choose(u, np.array([1.0, 0.99, 0.9, 0.1]), 2).tolist() == [0, 2]
    assert sorted(choose(u, np.ones(4), 9)) == [0, 1, 2, 3]


def test_a_score_that_is_no_number_does_not_poison_the_rest():
    u = RNG.uniform(size=(20, 3))
    found = choose(u, np.r_[np.nan, np.inf, np.linspace(0, 1, 18)], 5)
    assert len(set(found)) == 5


def test_around_what_failed_others_will_fail():
    u = np.array([[0.9, 0.9], [0.8, 0.9], [0.1, 0.1]])
    assert choose(u, np.array([5.0, 4.0, 1.0]), 1, failed=np.array([[0.85, 0.9]])).tolist() == [2]


def test_a_committee_differs_most_where_there_is_no_data():
    training = dataset(80, 1)
    near = training.delta_a.sum(axis=1) < 20  # of 0 ... 40 mm
    parts = [training.take(near & (np.arange(80) % 3 != fold)) for fold in range(3)]
    models = [build(model_card("spectral", part), fit(part, max_degree=6).arrays) for part in parts]
    test = dataset(60, 2).delta_a
    found = disagreement(models[0], models[1:], test, np.zeros((60, 0)))
    far = test.sum(axis=1) > 26
    assert np.median(found[far]) > 30 * np.median(found[~far])
