"""A locked compliance that is singular, in a direction that turns with the state, is learned and stays semidefinite."""

from dataclasses import replace
from functools import cache

import numpy as np
from surrogate.synthetic import dataset

from cfem.predict.load import build
from cfem.surrogate.definiteness import definiteness
from cfem.surrogate.error_measures import measure
from cfem.surrogate.model_card import model_card
from cfem.surrogate.semidefinite import NEAR, locked_compliance
from cfem.surrogate.series.spectral import fit
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


def test_W_is_positive_definite_everywhere_at_hardly_any_loss():
    training, card, arrays = learned()
    test = locked(2, 100)
    before = build(card, arrays)
    assert definiteness(before, training, 2000)["share"] < 0.9
    found = locked_compliance(before, training)
    assert -1e-3 < found["least"] < NEAR and len(found["sizes"]) == 3
    after = build({**card, "semidefinite": found["sizes"]}, arrays)
    assert definiteness(after, training, 20_000)["share"] == 1.0
    losses = [measure(test, *predictions(model, test))["loss"] for model in (before, after)]
    assert losses[1] < 1.01 * losses[0]


def test_a_model_that_is_definite_pays_nothing():
    training = dataset(40, 1)
    arrays = fit(training, max_degree=6).arrays
    found = locked_compliance(build(model_card("spectral", training, form="displacement"), arrays), training)
    assert found["least"] > NEAR and found["sizes"] is None
