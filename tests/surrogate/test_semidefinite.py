"""A locked compliance that is singular, in a direction that turns with the state, is learned and stays semidefinite."""

from dataclasses import replace
from functools import cache

import numpy as np
from surrogate.synthetic import dataset

from cfem.predict.energy import layout
from cfem.predict.load import build
from cfem.surrogate.definiteness import between, definiteness, smallest_eigenvalue
from cfem.surrogate.error_measures import measure
from cfem.surrogate.model_card import model_card
from cfem.surrogate.semidefinite import LARGEST, SEED, STATES, lifted
from cfem.surrogate.spectral import fit
from cfem.surrogate.stage import predictions


def locked(seed, count=40):
    """The actuators, locked, let the end move across a direction only that turns with them."""
    free = dataset(count, seed)
    angle = 0.03 * free.delta_a[:, 0]
    n = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(count)])
    e, a = free.rows.e, free.rows.a
    W = free.W.copy()
    motion = W[:, e, a] @ np.linalg.solve(W[:, a, a], W[:, a, e])
    W[:, e, e] = motion + 2.0 * (np.eye(3) - n[:, :, None] * n[:, None, :])
    return replace(free, W=W)


@cache
def learned(form="displacement"):
    training = locked(1)
    found = fit(training, form, max_degree=8)
    return training, model_card("spectral", training, form), found.arrays


def test_W_is_positive_definite_between_the_samples_at_hardly_any_loss():
    training, card, arrays = learned()
    test = locked(2, 100)
    before = build(card, arrays)
    assert definiteness(before, training, 2000)["share"] < 0.9
    better, constant = lifted(before, arrays, training)
    after = build(card, better)
    assert 0 < constant <= LARGEST
    assert definiteness(after, training, 20_000)["share"] == 1.0
    losses = [measure(test, *predictions(model, test))["loss"] for model in (before, after)]
    assert losses[1] < 2 * losses[0]


def test_only_the_diagonal_of_C_moves_and_by_the_same_everywhere():
    training, card, arrays = learned()
    better, _ = lifted(build(card, arrays), arrays, training)
    change = build(card, better).evaluate(training.delta_a)[0] - build(card, arrays).evaluate(training.delta_a)[0]
    e = training.rows.e
    np.testing.assert_allclose(change, np.broadcast_to(change[0], change.shape), atol=1e-13)
    assert (np.diag(change[0])[e] > 0).all() and np.abs(change[0] - np.diag(np.diag(change[0]))).max() < 1e-13
    assert np.abs(np.diag(change[0])[training.rows.a]).max() == 0.0


def test_a_model_that_is_definite_stays_as_it_is():
    training = dataset(40, 1)
    arrays = fit(training, max_degree=6).arrays
    same, constant = lifted(build(model_card("spectral", training, form="displacement"), arrays), arrays, training)
    assert constant == 0.0 and same is arrays


def test_a_model_that_is_far_from_semidefinite_is_left_to_be_judged():
    training, card, arrays = learned()
    spoiled = {**arrays, "series": arrays["series"].copy()}
    spoiled["series"][layout(2, 3)["effector_compliance"]] *= -1.0
    same, constant = lifted(build(card, spoiled), spoiled, training)
    assert constant == 0.0 and same is spoiled


def test_a_network_takes_the_constant_in_its_polynomial():
    from cfem.surrogate.energy_net import fit as fit_net
    from cfem.surrogate.spec import EnergyNetSpec

    training = dataset(40, 1)
    arrays, facts, _ = fit_net(training, EnergyNetSpec(kind="energy_net", width=8, iterations=5), None)
    card = model_card("energy_net", training, **facts)
    C, diagonal = layout(2, 3)["effector_compliance"], np.array([0, 3, 5])
    e, a = training.rows.e, training.rows.a
    states = between(build(card, arrays), training, STATES, SEED)
    W = build(card, arrays).evaluate(*states)[0]
    own = W[:, e, e] - W[:, e, a] @ np.linalg.solve(W[:, a, a], W[:, a, e])
    lower = {**arrays, "polynomial": arrays["polynomial"].copy()}
    lower["polynomial"][0, C.start + diagonal] -= np.linalg.eigvalsh(own)[:, 0].min() + 1e-9
    better, constant = lifted(build(card, lower), lower, training)
    assert 0 < constant <= LARGEST
    before, after = (build(card, each).evaluate(*states)[0] for each in (lower, better))
    assert smallest_eigenvalue(before).min() < 0 < smallest_eigenvalue(after).min()
