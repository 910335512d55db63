"""What models say of themselves, against a robot whose energy is known in closed form."""

import json
from pathlib import Path

import numpy as np
import pytest
from report.synthetic import trained as made_up
from surrogate.stored import store_dataset, train_folder
from surrogate.synthetic import dataset, effector, states

from cfem.core.artefact.manifest import read_manifest, write_manifest
from cfem.core.errors import GateError, InputError, SpecError
from cfem.core.spec import load_spec
from cfem.core.stage import Options
from cfem.predict.load import load_model
from cfem.report.sections.choices import choice_table
from cfem.report.sections.models import definite_table, model_table, trained
from cfem.report.sections.trust import Trust, trust, trust_summary, trust_table
from cfem.report.spec import ReportSpec
from cfem.report.stage import run

QUIET = Options(quiet=True)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two models of one dataset: spectral/model, mlp/model; spectral/samples."""
    root = tmp_path_factory.mktemp("models")
    train_folder(root / "spectral", "{kind: spectral, max_degree: 6}")
    train_folder(root / "mlp", "{kind: mlp, width: 8, depth: 1, epochs: 10}")
    return root


@pytest.fixture(scope="module")
def judged(folder):
    """Forty test states, and those of forty that lie beyond the reach of [0, 20 mm]."""
    inner = dataset(40, seed=5)
    outer = dataset(40, seed=6)
    far = {name: values for name, values in states(2 * outer.delta_a, np.ones(40)).items()}
    beyond = type(outer)(**{**outer.__dict__, **far})
    return trust(load_model(folder / "spectral" / "model"), inner, beyond), inner, beyond


def test_the_tip_error_is_that_against_the_closed_form(folder, judged):
    found, inner, _ = judged
    model = load_model(folder / "spectral" / "model")
    for i in (0, 17):
        tip = model.at_displacement(inner.delta_a[i]).delta_e
        assert found.error[i] == pytest.approx(np.linalg.norm(tip - effector(inner.delta_a[i : i + 1])[0][0]), rel=1e-6)


def test_states_beyond_the_reach_have_larger_errors_and_are_flagged(judged):
    found, _, beyond = judged
    assert 10 < found.beyond.sum() == (beyond.delta_a > 20).any(axis=1).sum() < 40
    assert not found.beyond[:40].any() and found.beyond[40:].all()
    assert found.inside[:40].mean() > 0.8 and found.inside[40:].mean() < 0.2
    summary = trust_summary(found)
    assert summary["flagged_mm"]["max"] > 100 * summary["unflagged_mm"]["max"]
    assert summary["rank_correlation"] > 0.3


def test_a_summary_counts_states_without_an_answer_as_flagged():
    found = Trust(
        error=np.array([1.0, 2.0, np.nan, 8.0]),
        distance=np.array([0.5, 1.0, np.nan, 4.0]),
        inside=np.array([True, True, False, False]),
        beyond=np.array([False, False, False, True]),
    )
    assert trust_summary(found) == {
        "states": 3,
        "flagged": 1,
        "beyond": 1,
        "beyond_flagged": 1,
        "without_answer": 1,
        "unflagged_mm": {"median": 1.5, "max": 2.0},
        "flagged_mm": {"median": 8.0, "max": 8.0},
        "rank_correlation": pytest.approx(1.0),
    }
    (row,) = trust_table({"a": trust_summary(found)}).rows
    assert row == ("a", "1 of 3", "1 of 1", "1.5 / 2 mm", "8 / 8 mm", "1")


def test_tables_mark_the_default_and_say_where_W_is_not_definite():
    bad = {"queries": 1000, "share": 0.997, "smallest_eigenvalue": -0.1, "where": {"s": [1.5, 2.0], "p": [0.45]}}
    series = {"terms": {"potential": 6, "effector": 3}, "weights": {"potential": [1.0, 1.25]}}
    network = {"best_epoch": 7, "device": "cpu", "judgement": [{"what": "loss 2"}]}
    models = {"a": made_up("spectral", **series), "b": made_up("mlp", positive_definite=bad, **network)}
    assert [row[0] for row in model_table(models, None, "a").rows] == ["a (default)", "b"]
    good, lacking = definite_table(models).rows
    assert good[1] == "0 of 1000" and good[3] == ""
    assert lacking[1] == "3 of 1000" and lacking[3] == "(1.5, 2) mm, p = (0.45)"
    assert choice_table(models).rows == [
        ("a", "terms of the Chebyshev series", "energy: 6; position of the effectors: 3"),
        (
            "a",
            "weight of each input direction in the degree of the series (2: half the degree along it)",
            "energy: 1, 1.2",
        ),
        ("b", "epoch of the smallest validation loss", "7"),
        ("b", "device", "cpu"),
    ]


def test_the_surface_of_a_model_is_told_with_units():
    skin = {"modes": 15, "nodes": 2082, "terms": {"rows": 60}, "rms_mm": 4.4e-4, "largest_mm": 2.63e-3}
    skin |= {"largest_percent_of_length": 0.00219, "front": {"rms_mm": [1.0]}, "seconds_fit": 0.11}
    ((what, said),) = choice_table({"a": made_up("spectral", skin=skin)}).rows
    assert what == "surface" and said == (
        "2082 nodes in 15 modes; error at the test states 0.44 µm rms, 2.63 µm at most (0.0022 % of the length); "
        "fitted in 110 ms"
    )


def test_no_choice_of_a_model_is_shown_by_a_raw_key(folder):
    results = {name: read_manifest(folder / name / "model")["results"] for name in ("spectral", "mlp")}
    for _, what, value in choice_table(results).rows:
        assert "_" not in what + value and value


def test_a_folder_that_measured_less_is_refused():
    old = made_up("spectral")
    del old["learning_curve"][0]["seconds_sampling"]
    for results in (old, {"rows": {}}):
        with pytest.raises(InputError, match="run cfem train"):
            trained(results, Path("models/old"))


def test_states_of_another_robot_are_refused(folder):
    with pytest.raises(InputError, match="another robot"):
        trust(load_model(folder / "spectral" / "model"), dataset(10, seed=5, n_a=3, unilateral=False))


PAGE = """
out: page
surrogates:
  synthetic:
    models: {spectral: spectral/model, network: mlp/model}
    default: spectral
    samples: spectral/samples
    beyond: beyond
    published: {source: a paper, samples: 6500, loss: 3.79e-6}
sampling:
  grid: {spectral: [spectral/model]}
  random: {spectral: [spectral/model, mlp/model]}
"""


@pytest.fixture(scope="module")
def page(folder):
    store_dataset(folder / "beyond", train=10, test=10, test_seed=9)
    for samples in (folder / "beyond", folder / "spectral" / "samples"):
        manifest = json.loads((samples / "manifest.json").read_text())
        write_manifest(samples, {**manifest, "made_from": "a robot in closed form", "seconds": 0.0})
    (folder / "report.yaml").write_text(PAGE)
    run(folder / "report.yaml", [], None, QUIET)
    return folder / "page"


def test_one_page_holds_models_and_studies_of_robots_without_a_scene(page):
    text = (page / "report.html").read_text()
    for words in (
        "Models of synthetic",
        "spectral (default)",
        "a paper",
        "0 of 100000",
        "compliance of the effectors",
        "grid",
    ):
        assert words in text, words
    assert "http" not in text.replace("http-equiv", "") and "<img" not in text
    # one number of samples a model: nothing to draw errors against
    names = {path.stem.rstrip("-123") for path in page.glob("*.svg")}
    assert names == {"synthetic-training", "synthetic-trust", "sampling"}
    facts = json.loads((page / "results.json").read_text())
    assert facts["synthetic"]["trust"]["spectral"]["states"] == 20
    assert facts["synthetic"]["trust"]["spectral"]["beyond"] == 0
    assert [row["samples"] for row in facts["sampling"]] == [40] * 3


def test_the_page_is_stale_where_what_it_says_changes(page):
    spec = page.parent / "report.yaml"
    assert run(spec, [], None, QUIET)["status"] == "up to date"
    for change in ("surrogates.synthetic.default=network", "surrogates.synthetic.published.samples=10"):
        with pytest.raises(GateError):
            run(spec, [change], None, Options(check=True))


@pytest.mark.parametrize(
    "text, words",
    [
        ("out: o\nsurrogates: {a: {models: {}}}\n", "models"),
        ("out: o\nsurrogates: {a: {models: {m: x}, default: n}}\n", "'n' is none of the models m"),
        ("out: o\n", "nothing to report"),
        ("out: o\nmesh: a\nsamples: b\nmodels: {m: c}\ncontrol: d\n", "scene"),
    ],
)
def test_mistakes_in_the_spec_are_named(tmp_path, text, words):
    (tmp_path / "report.yaml").write_text(text)
    with pytest.raises(SpecError, match=words):
        load_spec(tmp_path / "report.yaml", ReportSpec)
