"""The network learns a small robot in seconds, the same way each time, and never sees what it is not given."""

import numpy as np
import pytest
import torch
from surrogate.synthetic import dataset

from cfem.predict.load import build
from cfem.surrogate.error_measures import measure
from cfem.surrogate.mlp import train
from cfem.surrogate.model_card import model_card
from cfem.surrogate.spec import MlpSpec

SMALL = MlpSpec(kind="mlp", width=48, depth=2, activation="silu", epochs=150, batch_size=32, learning_rate=3e-3)


def test_it_learns_the_robot():
    training, test = dataset(300, 1), dataset(100, 2)
    found = train(training, SMALL)
    card = model_card("mlp", training, activation="silu")
    errors = measure(test, *build(card, found.model.arrays()).evaluate(test.delta_a))
    assert errors["loss"] < 5e-3
    assert found.history[-1]["validation"] < found.history[0]["validation"] / 100


@pytest.mark.parametrize("schedule", ["plateau", "cosine"])
def test_it_is_deterministic_and_leaves_the_global_generator_alone(schedule):
    spec = SMALL.model_copy(update={"epochs": 3, "schedule": schedule})
    before = torch.get_rng_state()
    first, second = (train(dataset(40, 1), spec).model.arrays() for _ in range(2))
    assert torch.equal(before, torch.get_rng_state())
    assert all(np.array_equal(first[name], second[name]) for name in first)
    other = train(dataset(40, 1), spec.model_copy(update={"seed": 1})).model.arrays()
    assert not np.array_equal(first["weight_0"], other["weight_0"])


def test_validation_rows_do_not_enter_the_scales():
    clean, spoiled = dataset(40, 1), dataset(40, 1)
    spoiled.delta_free[9::10] += 100.0
    spec = SMALL.model_copy(update={"epochs": 1})
    one, other = (train(data, spec).model.arrays() for data in (clean, spoiled))
    assert all(np.array_equal(one[name], other[name]) for name in one)


def test_a_constant_entry_is_returned_as_it_is():
    training = dataset(40, 1)
    training.W[:, 0, 1] = training.W[:, 1, 0] = 0.25
    W, _ = train(training, SMALL.model_copy(update={"epochs": 2})).model(torch.as_tensor(training.delta_a))
    assert torch.equal(W[:, 0, 1], torch.full((40,), 0.25, dtype=torch.float64))


def test_it_stops_early_when_validation_stalls():
    spec = SMALL.model_copy(update={"epochs": 10_000, "patience": 5, "learning_rate": 0.1})
    found = train(dataset(40, 1), spec)
    assert found.history[-1]["epoch"] - found.best_epoch >= 5
    assert found.history[-1]["epoch"] < 2000
