"""Rows of a pulling plan are found by the model where they are."""

from itertools import product

import numpy as np
import pytest
from support.fast_cases import fast_are
from surrogate.synthetic import dataset

from cfem.active_learning.place import effectors, place
from cfem.predict.load import build
from cfem.predict.series.energy import FORMS
from cfem.surrogate.model_card import model_card
from cfem.surrogate.series.spectral import fit


@pytest.mark.parametrize(
    "form, parameters", fast_are(zip(FORMS, [False, True], strict=True), product(FORMS, [False, True]))
)
def test_places_are_states_of_the_plan(form, parameters):
    training, test = dataset(150, 1, parameters=parameters), dataset(30, 2, parameters=parameters)
    model = build(model_card("spectral", training, form), fit(training, form).arrays)
    p = np.column_stack([test.p, np.full(30, 3.0)]) if parameters else np.zeros((30, 0))
    C = test.lambda_a / test.lambda_a.sum(axis=1, keepdims=True)
    target = (C * test.delta_a).sum(axis=1)
    true = test.delta_a if form == "displacement" else test.lambda_a
    start = np.tile(true.mean(axis=0), (30, 1)) + 0.1 * (true - true.mean(axis=0))
    s, found = place(model, C, target, p, start)
    near = 1e-3 if form == "displacement" or not parameters else 0.05
    assert found.all()
    assert np.allclose(s, true, atol=near * np.abs(true).max())
    assert np.allclose(effectors(model, s, p), test.delta_e, atol=near * 100)


def test_what_is_not_found_is_said():
    training = dataset(30, 1)
    model = build(model_card("spectral", training), fit(training).arrays)
    _, found = place(model, np.array([[0.5, 0.5]]), np.array([1e4]), np.zeros((1, 0)), training.delta_a[:1])
    assert not found.any()
