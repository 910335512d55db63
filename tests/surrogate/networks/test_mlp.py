"""The network learns a small robot in seconds, the same way each time, and never sees what it is not given."""

from itertools import count

import numpy as np
import pytest
import torch
from support.fast_cases import fast_are
from surrogate.stored import store_dataset
from surrogate.synthetic import POISSON, dataset

from cfem.core.artefact.unfinished import partial_folder
from cfem.core.errors import InputError, NumericalError
from cfem.core.stage import Options
from cfem.predict.load import build
from cfem.surrogate.error_measures import measure
from cfem.surrogate.model_card import model_card
from cfem.surrogate.networks import descent
from cfem.surrogate.networks.mlp import fit, train
from cfem.surrogate.spec import MlpSpec
from cfem.surrogate.stage import run

SMALL = MlpSpec(kind="mlp", width=48, depth=2, activation="silu", epochs=150, batch_size=32, learning_rate=3e-3)
TINY = SMALL.model_copy(update={"width": 8, "epochs": 12})


def predictor(training, spec):
    arrays, facts, _ = fit(training, spec)
    return build(model_card("mlp", training, **facts), arrays)


def killed_after(monkeypatch, epochs, training, spec, folder):
    """A fit that dies in the midst of the epoch after `epochs` of its last network."""
    with monkeypatch.context() as patch:
        whole = descent.epoch

        def dying(state, fitted, held_out):
            losses = whole(state, fitted, held_out)
            if state.record["epoch"] == epochs and state.spec.epochs == spec.epochs:
                raise KeyboardInterrupt
            return losses

        patch.setattr(descent, "epoch", dying)
        with pytest.raises(KeyboardInterrupt):
            fit(training, spec, folder)


def same(one, other):
    return one.keys() == other.keys() and all(np.array_equal(one[name], other[name]) for name in one)


def test_it_learns_the_robot():
    training, test = dataset(300, 1), dataset(100, 2)
    arrays, facts, history = fit(training, SMALL)
    model = build(model_card("mlp", training, **facts), arrays)
    assert measure(test, *model.evaluate(test.delta_a))["loss"] < 5e-3
    assert history[-1]["validation"] < history[0]["validation"] / 100
    assert facts["validation_loss"] <= min(record["validation"] for record in history)


@pytest.mark.parametrize("form", fast_are({"displacement"}, ["displacement", "force"]))
def test_parameters_are_inputs(form):
    training, test = (dataset(400, seed, parameters=True) for seed in (1, 2))
    model = predictor(training, SMALL.model_copy(update={"form": form}))
    s = test.delta_a if form == "displacement" else test.lambda_a
    p = np.column_stack([test.p, np.full(len(test), 3.0)])  # Young's modulus at its reference
    loss = [measure(test, *model.evaluate(s, p + shift))["loss"] for shift in (0, [(0.3 - POISSON.high) / 8, 0])]
    assert model.form == form and loss[0] < 0.01 and loss[1] > 10 * loss[0]
    soft, stiff = (model.at_displacement(test.delta_a[0], [0.4, young]) for young in (3.0, 6.0))
    assert np.allclose(stiff.W, soft.W / 2) and np.allclose(stiff.delta_free, soft.delta_free)


@pytest.mark.parametrize("schedule", ["plateau", "cosine"])
def test_it_is_deterministic_and_leaves_the_global_generator_alone(schedule):
    spec = TINY.model_copy(update={"epochs": 3, "schedule": schedule, "dropout": 0.2})
    before = torch.get_rng_state()
    first, second = (train(dataset(40, 1), spec).model.arrays() for _ in range(2))
    assert torch.equal(before, torch.get_rng_state())
    assert same(first, second)
    other = train(dataset(40, 1), spec.model_copy(update={"seed": 1})).model.arrays()
    assert not np.array_equal(first["weight_0"], other["weight_0"])


@pytest.mark.parametrize("kept", [0.0, np.inf], ids=["kept each epoch", "kept at the end only"])
@pytest.mark.parametrize("schedule", ["plateau", "cosine"])
def test_a_killed_training_ends_as_an_uninterrupted_one(tmp_path, monkeypatch, schedule, kept):
    monkeypatch.setattr(descent, "CHECKPOINT_SECONDS", kept)
    spec = TINY.model_copy(update={"schedule": schedule, "dropout": 0.2, "patience": 5})
    training = dataset(60, 1)
    arrays, facts, history = fit(training, spec)
    for epochs in (3, 7):
        killed_after(monkeypatch, epochs, training, spec, tmp_path)
    resumed = fit(training, spec, tmp_path)
    assert same(resumed[0], arrays) and resumed[1:] == (facts, history)
    monkeypatch.setattr(descent, "epoch", None)  # all is done: it trains no more
    assert same(fit(training, spec, tmp_path)[0], arrays)


def test_a_killed_training_redoes_only_what_was_not_kept(tmp_path, monkeypatch):
    clock = count(step=descent.CHECKPOINT_SECONDS / 3 + 0.1)
    monkeypatch.setattr(descent.time, "monotonic", lambda: next(clock))
    killed_after(monkeypatch, 7, dataset(40, 1), TINY, tmp_path)
    epochs = []
    whole = descent.epoch
    monkeypatch.setattr(
        descent, "epoch", lambda state, *rows: epochs.append(state.record["epoch"]) or whole(state, *rows)
    )
    fit(dataset(40, 1), TINY, tmp_path)
    assert epochs[0] in (5, 6, 7) and len(epochs) == TINY.epochs - epochs[0]


def test_other_rows_or_another_spec_do_not_go_on_from_a_checkpoint(tmp_path):
    arrays = fit(dataset(40, 1), TINY)[0]
    for training, spec in ((dataset(40, 3), TINY), (dataset(40, 1), TINY.model_copy(update={"seed": 1}))):
        fit(training, spec, tmp_path)
    assert same(fit(dataset(40, 1), TINY, tmp_path)[0], arrays)
    assert len(list(tmp_path.iterdir())) == 3


@pytest.mark.slow
def test_a_killed_command_goes_on_and_leaves_no_checkpoint(tmp_path, monkeypatch):
    store_dataset(tmp_path / "samples")
    spec = tmp_path / "train.yaml"
    spec.write_text(
        "dataset: samples\nout: model\nlearning_curve: [20]\nmodel: {kind: mlp, width: 8, depth: 2, epochs: 8}\n"
    )
    whole = run(spec, ["out=whole"], None, Options())
    assert "checkpoints" not in {path.parts[0] for path in map(type(spec), whole["files"])}
    begun, epoch = count(), descent.epoch

    def dying(*arguments):
        if next(begun) in (3, 7, 9, 13):
            raise KeyboardInterrupt
        return epoch(*arguments)

    monkeypatch.setattr(descent, "epoch", dying)
    monkeypatch.setattr(descent, "CHECKPOINT_SECONDS", 0.0)
    for _ in range(4):
        with pytest.raises(KeyboardInterrupt):
            run(spec, ["out=killed"], None, Options())
        assert any((partial_folder(tmp_path / "killed") / "checkpoints").iterdir())
    killed = run(spec, ["out=killed"], None, Options())
    assert killed["files"] == whole["files"]


def test_dropout_is_off_when_it_is_judged_and_used():
    training = dataset(60, 1)
    found = train(training, SMALL.model_copy(update={"dropout": 0.5, "epochs": 20}))
    held_out = training.take(np.arange(9, 60, 10))
    model = found.model
    with torch.no_grad():
        W, delta_free = model(torch.tensor(held_out.delta_a))
        assert torch.equal(W, model(torch.tensor(held_out.delta_a))[0])
    upper = np.triu_indices(training.rows.n)
    errors = np.hstack([W.numpy()[:, *upper] - held_out.W[:, *upper], delta_free.numpy() - held_out.delta_free])
    scale = model.out_scale.numpy()
    assert found.validation == pytest.approx(np.mean((errors[:, scale > 0] / scale[scale > 0]) ** 2), rel=1e-4)


def test_device_auto_is_the_cpu_where_there_is_no_gpu(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    _, facts, _ = fit(dataset(40, 1), TINY)
    assert facts["device"] == "cpu" and TINY.device == "auto"
    with pytest.raises(InputError, match="no GPU"):
        fit(dataset(40, 1), TINY.model_copy(update={"device": "cuda"}))


def test_the_cpu_is_taken_where_it_is_asked_for(monkeypatch):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    assert descent_device("auto") == "cuda" and descent_device("cpu") == "cpu"


def descent_device(name):
    from cfem.surrogate.networks.mlp import device_of

    return device_of(TINY.model_copy(update={"device": name})).type


def test_validation_rows_do_not_enter_the_scales():
    clean, spoiled = dataset(40, 1), dataset(40, 1)
    spoiled.delta_free[9::10] += 100.0
    spec = TINY.model_copy(update={"epochs": 1})
    one, other = (train(data, spec).model.arrays() for data in (clean, spoiled))
    assert same(one, other)


def test_a_constant_entry_is_returned_as_it_is():
    training = dataset(40, 1)
    training.W[:, 0, 1] = training.W[:, 1, 0] = 0.25
    W, _ = train(training, TINY).model(torch.as_tensor(training.delta_a))
    assert torch.equal(W[:, 0, 1], torch.full((40,), 0.25, dtype=torch.float64))


def test_an_input_that_never_varied_changes_nothing():
    training = dataset(40, 1, parameters=True)
    training.p[:] = 0.4
    model = predictor(training, TINY)
    W = [model.evaluate(training.delta_a, np.tile([poisson, 3.0], (40, 1)))[0] for poisson in (0.4, 0.45)]
    assert np.isfinite(W[0]).all() and np.array_equal(*W)


@pytest.mark.parametrize("schedule", ["plateau", "cosine"])
def test_it_stops_early_when_validation_stalls(schedule):
    spec = TINY.model_copy(update={"epochs": 10_000, "patience": 5, "learning_rate": 0.1, "schedule": schedule})
    found = train(dataset(40, 1), spec)
    assert found.history[-1]["epoch"] - found.best_epoch == 5
    assert found.history[-1]["validation"] > found.validation


def test_too_few_rows_and_divergence_are_one_sentence():
    with pytest.raises(InputError, match="9 training rows are too few"):
        train(dataset(9, 1), TINY)
    with pytest.raises(NumericalError, match="diverges in epoch"):
        train(dataset(40, 1), TINY.model_copy(update={"learning_rate": 1e30}))


def test_the_tests_compute_on_one_thread():
    assert torch.get_num_threads() == 1  # more of them wait for each other, at two thirds of the suite's CPU time
