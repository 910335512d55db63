"""The search alone, on losses that are known: what it picks, prunes, keeps and repeats."""

import json
import math

import pytest

from cfem.core.errors import NumericalError, SpecError
from cfem.core.spec import load_spec
from cfem.surrogate.networks.search import search
from cfem.surrogate.spec import MlpSearch, TrainSpec

OVER = {"learning_rate": [1e-4, 1e-2], "width": [10, 1000], "activation": ["relu", "silu"]}
SPEC = MlpSearch(over=OVER, trials=25, epochs=8)


def judge(choice, report):
    """Least at a rate of 1e-3, 100 wide, with silu; it falls by half an epoch."""
    miss = abs(math.log10(choice["learning_rate"]) + 3) + abs(math.log10(choice["width"]) - 2)
    loss = 0.1 + miss + (choice["activation"] == "relu")
    for epoch in range(1, 9):
        report(epoch, loss * (1 + 0.5**epoch))
    return loss


def test_it_finds_the_least_loss_within_its_ranges():
    found = search(judge, SPEC, seed=0)
    assert found["choice"]["activation"] == "silu" and 1e-4 <= found["choice"]["learning_rate"] <= 1e-2
    losses = {trial["number"]: trial["loss"] for trial in found["trials"] if trial["state"] == "complete"}
    best = min(losses, key=losses.get)
    assert losses[best] < 0.4 and found["choice"] == found["trials"][best]["choice"]


def test_trials_worse_than_most_are_pruned():
    run = []

    def counting(choice, report):
        def counted(epoch, loss):
            run.append(epoch)
            report(epoch, loss)

        return judge(choice, counted)

    trials = search(counting, SPEC, seed=0)["trials"]
    pruned = [trial for trial in trials if trial["state"] == "pruned"]
    assert 3 <= len(pruned) < 25 and all(trial["loss"] is None for trial in pruned)
    assert len(run) < 25 * 8


def test_the_same_seed_gives_the_same_trials():
    first, second, other = (search(judge, SPEC, seed) for seed in (0, 0, 100))
    assert first == second and first["trials"] != other["trials"]


def test_a_killed_search_ends_as_an_uninterrupted_one(tmp_path):
    table, begun = tmp_path / "table.json", []

    def fragile(choice, report):
        begun.append(choice)
        if table.exists() and len(begun) in (3, 12):
            raise KeyboardInterrupt
        if choice["learning_rate"] > 4e-3:
            report(1, 3.0)
            raise NumericalError("diverges")
        return judge(choice, report)

    whole = search(fragile, SPEC, seed=0)
    assert {trial["state"] for trial in whole["trials"]} == {"complete", "pruned", "diverged"}
    begun.clear()
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            search(fragile, SPEC, seed=0, table=table)
    assert search(fragile, SPEC, seed=0, table=table) == whole
    assert len(begun) == 25 + 2 and len(json.loads(table.read_text())["trials"]) == 25


def test_no_trial_begins_after_its_seconds():
    assert len(search(judge, SPEC.model_copy(update={"seconds": 1e-9}), seed=0)["trials"]) == 1


def test_it_says_where_no_trial_ended_well():
    def diverging(choice, report):
        raise NumericalError("diverges")

    with pytest.raises(NumericalError, match="all 2 trials failed"):
        search(diverging, SPEC.model_copy(update={"trials": 2}), seed=0)


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ("{}", "name one or more of depth, width"),
        ("{width: [9, 4]}", "width: 9 is greater than 4"),
        ("{widht: [4, 9]}", "did you mean 'width'"),
        ("{activation: [swish]}", "'silu'"),
    ],
)
def test_ranges_that_make_no_sense_are_refused(tmp_path, over, words):
    path = tmp_path / "train.yaml"
    path.write_text(f"dataset: d\nout: o\nmodel:\n  kind: mlp\n  search:\n    over: {over}\n")
    with pytest.raises(SpecError, match=words):
        load_spec(path, TrainSpec)
