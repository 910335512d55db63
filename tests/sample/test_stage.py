"""The bar from scene to dataset: finite elements, worker processes, manifest, and when nothing is done."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from cfem.core.errors import GateError, OutputError
from cfem.core.stage import Options, artefact_file, read_manifest
from cfem.dataset.inspect import describe
from cfem.dataset.reader import read_dataset
from cfem.robot import stage as mesh_stage
from cfem.sample.stage import run

PIPELINE = Path(__file__).parents[2] / "pipelines" / "bar"
QUIET = Options(quiet=True)
SMALL = ["splits.train.rows=6", "splits.test.rows=3", "skeleton=4", "shard=3"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """pipelines/bar with its mesh, in a place of its own."""
    root = tmp_path_factory.mktemp("bar")
    pipeline = shutil.copytree(PIPELINE, root / "pipelines" / "bar")
    mesh_stage.run(pipeline / "scene.yaml", [], None, QUIET)
    run(pipeline / "sample.yaml", SMALL, None, QUIET, workers=2)
    return root


@pytest.fixture
def spec(folder):
    return folder / "pipelines" / "bar" / "sample.yaml"


@pytest.fixture
def samples(folder):
    return folder / "data" / "bar" / "samples"


def test_the_folder_holds_the_splits_and_nothing_of_the_work(samples):
    assert sorted(path.name for path in samples.iterdir()) == ["manifest.json", "test.parquet", "train.parquet"]
    assert [path.name for path in samples.parent.iterdir() if "partial" in path.name] == []
    results = read_manifest(samples)["results"]
    assert results["rows"] == {"train": 6, "test": 3} and results["failed"] == 0
    assert 1 <= results["factorizations_per_sample"] < 6 and results["residual_max"] < 1e-8
    assert "dataset of bar: 9 states" in describe(samples)


def test_the_states_obey_the_condensed_identities(samples):
    train = read_dataset(artefact_file(samples, "train.parquet"))
    a, delta = train.rows.a, np.hstack([train.delta_e, train.delta_a])
    np.testing.assert_allclose(
        np.einsum("mij,mj->mi", train.W[:, :, a], train.lambda_a) + train.delta_free, delta, atol=1e-9
    )
    assert np.linalg.eigvalsh(train.W).min() > 0
    order = np.argsort(train.delta_a[:, 0])
    work = np.diff(train.energy[order])
    lam, shortening = train.lambda_a[order, 0], np.diff(train.delta_a[order, 0])
    assert (lam[:-1] * shortening < work).all() and (work < lam[1:] * shortening).all()


def test_the_plan_is_a_pull_by_shares_of_the_reach(samples):
    test = read_dataset(artefact_file(samples, "test.parquet"))
    np.testing.assert_allclose(test.delta_a, test.u * test.meta["reach"][0][1], rtol=1e-8)


def test_unchanged_inputs_run_nothing_and_a_comment_is_no_change(spec):
    scene = spec.parent / "scene.yaml"
    scene.write_text(scene.read_text() + "\n# a comment\n")
    assert run(spec, SMALL, None, QUIET)["status"] == "up to date"
    with pytest.raises(GateError):
        run(spec, [*SMALL, "tolerance=1e-9"], None, Options(check=True))


def test_other_inputs_do_not_overwrite_what_was_dear(spec, samples):
    before = read_manifest(samples)
    with pytest.raises(OutputError, match="other inputs"):
        run(spec, [*SMALL, "splits.train.rows=7"], None, QUIET)
    assert read_manifest(samples) == before


def test_one_worker_gives_the_same_content_as_two(spec, samples, tmp_path):
    alone = run(spec, SMALL, tmp_path / "samples", QUIET, workers=1)
    assert alone["content"] == read_manifest(samples)["content"]
