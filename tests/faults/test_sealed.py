"""Files that no stage wrote, behind a manifest that fits them: exit code 3 and one sentence with the file, or a correct
answer; never a defect of ours, never a hang."""

import json
import os
import shutil
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.fast_cases import fast_are
from support.sealed import change_arrays, change_json, outcome, refused, reseal
from surrogate.stored import train_folder
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.manifest import MANIFEST, write_manifest
from cfem.dataset.schema import KEY

NAN, INF = float("nan"), float("inf")


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """A dataset, a model trained from it, and the specs of what reads them."""
    root = tmp_path_factory.mktemp("sealed")
    train_folder(root, "{kind: spectral, max_degree: 2}", train=12, test=5)
    (root / "export.yaml").write_text("model: model\nout: exported\nformats: [arrays]\n")
    reseal(root / "samples")
    reseal(root / "model")
    return root


@pytest.fixture
def own(project, tmp_path):
    shutil.copytree(project, tmp_path / "own")
    return tmp_path / "own"


# ---- datasets


def column(name, value, row=1):
    def change(table):
        stored = table[name].to_pylist()
        stored[row] = [value, *stored[row][1:]] if isinstance(stored[row], list) else value
        index, field = table.column_names.index(name), table.schema.field(name)
        return table.set_column(index, field, pa.array(stored, field.type))

    return change


def metadata(**changes):
    def change(table):
        data = json.loads(table.schema.metadata[KEY]) | changes
        return table.replace_schema_metadata({KEY: json.dumps(data).encode()})

    return change


VALUES = [
    (name, value)
    for name in ("W", "delta_a", "delta_e", "lambda_a", "delta_free", "energy", "u")
    for value in (NAN, INF, 1e300, None)
    if value is not None or name not in ("u",)
]
METADATA = {
    "reach": [[0.0, NAN], [0.0, 20.0]],
    "rest_e": [0.0, 10.0],
    "length": -1.0,
    "scene": 'x */ #include "x" /*',
    "rows": {"effectors": ["tip.x", "tip.y", "tip.z"], "actuators": ['a"; system("x"); //', "b"], "contacts": []},
    "row_units": [["mm", "N"]] * 4,
    "parameters": [{"name": "p"}],
    "units": 3,
    "plan": [],
}


def harm_dataset(own, change, split="train"):
    path = own / "samples" / f"{split}.parquet"
    pq.write_table(change(pq.read_table(path)), path)
    reseal(own / "samples")
    return own / "train.yaml", f"{split}.parquet"


@pytest.mark.parametrize(
    "split, name, value",
    fast_are(
        [("train", name, NAN) for name, _ in VALUES]
        + [("test", "W", INF), ("train", "energy", 1e300), ("test", "u", INF), ("train", "delta_a", None)],
        [(split, *value) for split in ("train", "test") for value in VALUES],
    ),
)
def test_a_converged_state_has_numbers(own, split, name, value):
    spec, file = harm_dataset(own, column(name, value), split)
    assert f"column '{name}'" in refused(own, ("train", spec, "--quiet"), file)


@pytest.mark.parametrize("key", METADATA)
def test_metadata_follow_their_schema(own, key):
    spec, file = harm_dataset(own, metadata(**{key: METADATA[key]}))
    assert key in refused(own, ("train", spec, "--quiet"), file)
    refused(own, ("inspect", own / "samples"), file)


@pytest.mark.parametrize("changes", [{"length": 111.0}, {"rest_e": [0.0, 10.0, -1.0]}, {"scene": "other"}])
def test_training_and_test_rows_are_of_one_robot(own, changes):
    spec, _ = harm_dataset(own, metadata(**changes), "test")
    assert f"'{next(iter(changes))}' differs" in refused(own, ("train", spec, "--quiet"), "samples")


def test_more_rows_than_the_file_can_hold_are_not_read(own):
    """3 million rows in less than 1 MB would take a minute."""

    path = own / "samples" / "train.parquet"
    pq.write_table(pq.read_table(path).take(np.zeros(100_000, int)), path, compression="zstd")
    reseal(own / "samples")
    assert "rows" in refused(own, ("inspect", own / "samples"), "train.parquet")


# ---- models

CARD = (
    "format",
    "kind",
    "form",
    "scene",
    "rows",
    "row_units",
    "rest_e",
    "reach",
    "length",
    "parameters",
    "domain",
    "n_c",
)
OPTIONAL = ("errors", "history", "versions", "dataset")
ODD = [None, "x", -7, NAN, 1e400, [], {}, [[]], [NAN], {"x": 1}, True, "0", [["mm", "N"]], "kind\n"]


@pytest.mark.parametrize("key", CARD)
def test_a_model_without_one_of_its_keys(own, key):
    change_json(own / "model" / "model.json", lambda data: {k: data[k] for k in data if k != key})
    reseal(own / "model")
    refused(own, ("export", own / "export.yaml"), "model.json")


@pytest.mark.parametrize("key", fast_are({"rows", "reach", "parameters", "errors"}, [*CARD, *OPTIONAL]))
def test_a_model_with_something_else_under_a_key(own, key):
    """Whatever it is: refused, or the same export as before where nobody needs it."""
    whole = (own / "model" / "model.json").read_text()
    for value in ODD:
        (own / "model" / "model.json").write_text(json.dumps(json.loads(whole) | {key: value}))
        reseal(own / "model")
        code, line = outcome("export", own / "export.yaml", "--out", own / "again", "--force")
        assert code in ((0, 3) if key in (*OPTIONAL, "parameters", "scene") else (3,)), (key, value, line)
        assert not code or "model.json" in line


NESTED = {
    "reach as text": {"reach": [["0", "20"], ["0", "20"]]},
    "reach the wrong way round": {"reach": [[20.0, 0.0], [0.0, 20.0]]},
    "names that would be code": {"rows": {"effectors": ["tip.x", "tip.y", "tip.z"], "actuators": ['"; x("', "b"]}},
    "a row twice": {"rows": {"effectors": ["tip.x", "tip.x", "tip.z"], "actuators": ["a", "b"]}},
    "more rows than known": {"rows": {"effectors": ["x", "y", "z"], "actuators": ["a", "b"], "int x; //": ["c"]}},
    "a scene that would be code": {"scene": "x */ int y; /*"},
    "a domain without states": {"domain": {"delta_a": [[0, 0], [1, 1]], "lambda_a": [[0, 0], [1, 1]], "p": [[], []]}},
    "a model of modules without modules": {"kind": "serial"},
    "a network without activation": {"kind": "mlp"},
    "a model in a model": {"modules": [{"kind": "spectral"}]},
    "units of nothing": {"row_units": [["m", "N"]] * 5},
}


@pytest.mark.parametrize("what", NESTED)
def test_a_model_whose_parts_do_not_fit(own, what):
    change_json(own / "model" / "model.json", lambda data: data | NESTED[what])
    reseal(own / "model")
    refused(own, ("export", own / "export.yaml"), "model.json")


def test_a_model_nested_without_end(own):
    for text in ("[" * 100_000, '{"modules":[' * 3000 + "1" + "]}" * 3000):
        (own / "model" / "model.json").write_text(text)
        reseal(own / "model")
        refused(own, ("export", own / "export.yaml"), "model.json")


ARRAYS = {
    "no numbers": lambda a: a | {"series": a["series"] * NAN},
    "infinite numbers": lambda a: a | {"to_box": a["to_box"] + INF},
    "numbers beyond all sense": lambda a: a | {"series": a["series"] * 1e300 * 1e10},
    "numbers that overflow in use": lambda a: a | {"series": np.full_like(a["series"], 1e308)},
    "a missing array": lambda a: {name: a[name] for name in a if name != "offset"},
    "an empty array": lambda a: a | {"indices": a["indices"][:0]},
    "complex numbers": lambda a: a | {"series": a["series"] + 1j},
    "text": lambda a: a | {"offset": np.array(["0", "0"])},
    "another shape": lambda a: a | {"to_box": a["to_box"][:, :1]},
    "terms without coefficients": lambda a: a | {"series": a["series"][:, :-1]},
    "a negative degree": lambda a: a | {"indices": a["indices"] - 5},
    "a degree that no memory holds": lambda a: a | {"indices": a["indices"] + 2**40},
    "degrees that are no integers": lambda a: a | {"indices": a["indices"] + 0.5},
    "nothing": lambda a: {},
}


@pytest.mark.parametrize("what", ARRAYS)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_model_whose_arrays_are_not_the_kinds(own, what):
    change_arrays(own / "model" / "weights.npz", ARRAYS[what])
    reseal(own / "model")
    refused(own, ("export", own / "export.yaml"), "weights.npz")


def test_an_array_that_claims_8_TB(own):
    path = own / "model" / "weights.npz"
    header = np.lib.format.magic(1, 0) + (118).to_bytes(2, "little")
    text = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("series.npy", header + text.ljust(117) + b"\n" + bytes(8000))
    reseal(own / "model")
    refused(own, ("export", own / "export.yaml"), "weights.npz")


@pytest.mark.parametrize("text", [b"", b"PK\x03\x04", b"\x00" * 1000, b"\x93NUMPY\x01\x00"])
def test_what_is_no_archive_of_arrays(own, text):
    (own / "model" / "weights.npz").write_bytes(text)
    reseal(own / "model")
    refused(own, ("export", own / "export.yaml"), "weights.npz")


@pytest.mark.parametrize(
    "change", [lambda a: a | {"s": a["s"][:, :1]}, lambda a: {}, lambda a: a | {"W": a["W"] * NAN}]
)
def test_test_vectors_fit_the_model(own, change):
    change_arrays(own / "model" / "test_vectors.npz", change)
    reseal(own / "model")
    refused(own, ("export", own / "export.yaml"), "test_vectors.npz")


# ---- manifests, and what is no file

MANIFESTS = [
    {"seconds": "x"},
    {"versions": []},
    {"inputs": 1},
    {"results": []},
    {"results": {"headline": 5}},
    {"stage": 2},
]


@pytest.mark.parametrize("changes", MANIFESTS)
def test_manifests_follow_their_schema(own, changes):
    reseal(own / "model", **changes)
    for command in ("inspect", "summary"):
        assert next(iter(changes)) in refused(own, (command, own / "model"), MANIFEST)
    assert outcome("verify", own / "model")[0] == 3


def test_what_is_not_there_is_not_needed_to_look(own):
    write_manifest(own / "model", {"content": "x", "files": {}})
    assert outcome("inspect", own / "model")[0] == outcome("summary", own / "model")[0] == 0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes have names on Unix alone")
@pytest.mark.parametrize("name", [MANIFEST, "model.json"])
def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(own, name):
    (own / "model" / name).unlink()
    os.mkfifo(own / "model" / name)
    for words in (("verify", own / "model"), ("export", own / "export.yaml")):
        assert outcome(*words)[0] == 3
    if name == MANIFEST:
        refused(own, ("inspect", own / "model"), MANIFEST)


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b"[" * 100_000, b"\xff\xfe", b'{"content": "x"}', b"null"])
def test_what_is_no_manifest(own, text):
    (own / "model" / MANIFEST).write_bytes(text)
    refused(own, ("inspect", own / "model"), "model")


def test_what_a_terminal_obeys_is_shown_as_text(own):
    evil = "\x1b[2J\x1b]0;title\x07\u202e\r\x08"
    reseal(own / "model", results={"headline": [f"loss {evil}"]}, inputs={evil: evil})
    (own / "model" / f"{evil}.txt").write_text("")
    for command in ("inspect", "summary", "verify"):
        result = CliRunner().invoke(app, [command, str(own / "model")])
        said = result.stdout + result.stderr
        assert "\\x1b[2J" in said and said.replace("\n", "").isprintable()
