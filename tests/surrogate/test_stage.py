"""`cfem train` on a stored dataset: what it writes, what it must not look at."""

import json
import subprocess
import sys

import numpy as np
import pyarrow.parquet as pq
import pytest
from surrogate.stored import store_dataset, train_folder

from cfem.core.artefact.files import content_sha256, file_sha256, write_json
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.core.stage import Options
from cfem.predict.load import load_model, read_arrays
from cfem.surrogate.stage import run
from cfem.surrogate.verdict import headline, judged

SPEC = "dataset: samples\nout: model\nmodel: {kind: spectral, max_degree: 8}\nlearning_curve: [10, 20]\n"


@pytest.fixture
def spec(tmp_path):
    store_dataset(tmp_path / "samples")
    path = tmp_path / "train.yaml"
    path.write_text(SPEC)
    return path


def test_it_writes_a_model_that_knows_itself(spec):
    manifest = run(spec, [], None, Options())
    results = manifest["results"]
    model = load_model(spec.parent / "model")
    assert model.meta["errors"] == results["errors"]
    assert results["errors"]["loss"] < 1e-5 and results["errors"]["states"] == 20
    assert [point["samples"] for point in results["learning_curve"]] == [10, 20, 40]
    assert {record["quantity"] for record in results["history"]} == {
        "potential",
        "effector",
        "effector_compliance",
    }
    assert results["positive_definite"]["share"] == 1.0 and results["positive_definite"]["queries"] == 100_000
    assert results["model_error"]["states"] + results["model_error"]["left_out"] == 20
    assert model.model_error.model_dump(mode="json") == results["model_error"]
    assert run(spec, [], None, Options())["status"] == "up to date"


@pytest.mark.parametrize("limit", ["max_terms=1", "max_terms=3", "max_terms=1, form: force"])
def test_a_model_without_stiffness_is_told_and_not_a_defect(spec, limit):
    settings = limit.replace("=", ": ")
    with pytest.raises(NumericalError, match="40 samples has states without stiffness, where W is singular"):
        run(spec, [f"model={{kind: spectral, {settings}}}"], None, Options())


def test_a_degree_of_one_has_no_stiffness(spec):
    with pytest.raises(SpecError, match="max_degree: must be at least 2, got 1"):
        run(spec, ["model.max_degree=1"], None, Options())


@pytest.mark.parametrize("count, said", [(1, "1 test state (a figure of 1 state says"), (9, "9 test states (a figure")])
def test_figures_of_few_states_are_called_so(tmp_path, count, said):
    store_dataset(tmp_path / "samples", test=count)
    (tmp_path / "train.yaml").write_text(SPEC)
    results = run(tmp_path / "train.yaml", ["learning_curve=[]"], None, Options())["results"]
    assert said in results["headline"][0]
    inside = results["model_error"]["states"]
    promised = f"in {100 * inside / (inside + 1):.0f} % of the unseen states of its domain"
    assert f"{promised} (19 test states in it promise 95 %); " in results["headline"][1]
    unknown = "the paper's loss is not known, as the test states do not differ"
    assert (unknown in results["headline"][0]) == (count == 1)
    judged = [one["what"] for one in results.get("judgement", [])]
    assert any("test states do not differ" in one for one in judged) == (count == 1)


def test_a_poor_model_is_judged_in_words():
    sound = {
        "errors": {"frame_loss": 1e-6, "tip_mm": {"max": 0.01}},
        "positive_definite": {"share": 1.0, "queries": 100},
    }
    assert judged(sound) == []
    poor = {
        "errors": {"frame_loss": 4.64, "tip_mm": {"max": 0.28}},
        "positive_definite": {"share": 0.49, "queries": 100},
    }
    loss, definite = (one["what"] for one in judged(poor))
    assert loss.startswith("loss of whole vectors 4.64e+00") and "0.28 mm" in loss
    assert "51 % of 100 random states" in definite
    nan = {
        "errors": {"frame_loss": float("nan"), "tip_mm": {"max": 0.1}},
        "positive_definite": sound["positive_definite"],
    }
    assert len(judged(nan)) == 1


def test_training_twice_gives_the_same_content(spec):
    first = run(spec, [], None, Options())
    second = run(spec, [], None, Options(force=True))
    assert first["content"] == second["content"]


def test_test_rows_do_not_change_the_fit(tmp_path):
    models = [train_folder(tmp_path / str(seed), "{kind: spectral, max_degree: 8}", test_seed=seed) for seed in (2, 3)]
    one, other = (read_arrays(model) for model in models)
    assert all(np.array_equal(one[name], other[name]) for name in one)
    assert load_model(models[0]).meta["errors"] != load_model(models[1]).meta["errors"]


def test_rows_beyond_the_number_asked_for_do_not_change_the_fit(tmp_path):
    models = []
    for train in (40, 30):
        folder = tmp_path / str(train)
        store_dataset(folder / "samples", train=train)
        (folder / "train.yaml").write_text(SPEC)
        run(folder / "train.yaml", ["samples=30", "learning_curve=[]"], None, Options())
        models.append(read_arrays(folder / "model"))
    assert all(np.array_equal(models[0][name], models[1][name]) for name in models[0])


def test_more_samples_than_there_are_is_an_error(spec):
    with pytest.raises(InputError, match=r"samples: holds 40 converged training rows, and 41 are needed"):
        run(spec, ["samples=41"], None, Options())


@pytest.mark.parametrize(
    "key, other",
    [
        ("scene", "other"),
        ("rest_e", [1.0, 2.0, 3.0]),
        ("robot", {"material": {"young": 2.0}}),
        ("reach", [[0.0, 7.0]] * 2),
        ("length", 61.0),
    ],
)
def test_test_rows_of_another_robot_are_refused(spec, key, other):
    """As where a file of another dataset was copied in, and the manifest made to match."""
    folder = spec.parent / "samples"
    table = pq.read_table(folder / "test.parquet")
    meta = json.loads(table.schema.metadata[b"cfem"])
    assert meta.get(key) != other
    pq.write_table(table.replace_schema_metadata({"cfem": json.dumps({**meta, key: other})}), folder / "test.parquet")
    manifest = json.loads((folder / "manifest.json").read_text())
    files = {path.name: file_sha256(path) for path in folder.glob("*.parquet")}
    write_json(folder / "manifest.json", {**manifest, "content": content_sha256(files), "files": files})
    with pytest.raises(InputError, match=f"training and test rows are of different robots: their '{key}' differs"):
        run(spec, [], None, Options(quiet=True))
    assert not (spec.parent / "model").exists()


def test_an_unknown_key_names_the_near_one(spec):
    with pytest.raises(SpecError, match=r"max_degre.*did you mean 'max_degree'"):
        run(spec, ["model.max_degre=3"], None, Options())


def test_spectral_training_imports_no_torch(spec):
    code = (
        "import sys; from pathlib import Path; from cfem.core.stage import Options; "
        "from cfem.surrogate.stage import run; "
        f"run(Path({str(spec)!r}), ['learning_curve=[]'], None, Options()); print('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"


def test_mlp_is_stored_and_loaded(tmp_path):
    folder = train_folder(tmp_path, "{kind: mlp, width: 8, depth: 2, epochs: 2}")
    card = json.loads((folder / "model.json").read_text())
    assert card["activation"] == "relu" and card["kind"] == "mlp"
    stored = read_arrays(folder, "test_vectors.npz")
    W, _ = load_model(folder).evaluate(stored["s"], stored["p"])
    assert np.array_equal(W, stored["W"])


def trained():
    """Results of a training with 60 samples, and of one with 30."""
    measured = {
        "tip_mm": 0.012,
        "force_N": 0.34,
        "tip_percent_of_length": 0.66,
        "force_percent": 1.5,
        "W_percent": 20.0,
    }
    errors = {name: {"max": largest, "rms": 0.1 * largest} for name, largest in measured.items()}
    errors |= {"loss": 7e-6, "frame_loss": 5e-6, "states": 40}
    results = {"kind": "spectral", "samples": 60, "errors": errors, "seconds_fit": 1.0, "microseconds_query": 50.0}
    worse = errors | {"W_percent": {"max": 70.0, "rms": 9.0}}
    curve = [{"samples": 30, "errors": worse}, {"samples": 60, "errors": errors}]
    return {**results, "learning_curve": curve, "positive_definite": {"share": 1.0}}


def test_the_headline_states_errors_in_percent_for_each_number_of_samples():
    fewer, all_samples = headline(trained(), {})[1:]
    before = (
        "root mean square and largest errors: tip 0.066, 0.66 % of the length; actuators 0.15, 1.5 % of the largest"
    )
    assert fewer == f"30 samples, {before}; W_ij 9, 70 % of the root of W_ii W_jj"
    assert all_samples == f"60 samples, {before}; W_ij 2, 20 % of the root of W_ii W_jj"


@pytest.mark.parametrize(("unit", "said"), [("N", "N"), ("MPa", "MPa"), (["N", "MPa", "N"], "N or MPa")])
def test_the_headline_states_mm_and_the_unit_of_the_actuators_before_the_loss(unit, said):
    line = headline(trained(), {"lambda_a": unit})[0]
    losses = "the paper's loss 7.00e-06, the same loss of whole vectors 5.00e-06"
    assert f"largest errors 12 um at the tip and 0.34 {said} on 40 test states; {losses}" in line.replace("µ", "u")
