"""Robots that differ, each at rest: the designs of the other spaces, a factorisation each, nothing pulled."""

import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from sample.synthetic import Factory
from surrogate.synthetic import POISSON

from cfem.core.errors import SpecError
from cfem.core.stage import Options
from cfem.dataset.reader import as_dataset, read_dataset
from cfem.robot.stage import run as make_mesh
from cfem.sample.runner import sample
from cfem.sample.spec import SampleSpec
from cfem.sample.stage import run

SPEC = {
    "scene": "scene.yaml",
    "mesh": "mesh",
    "out": "out",
    "splits": {"train": {"rows": 12, "method": "scrambled-halton", "seed": 1}, "test": {"rows": 5, "method": "random"}},
    "skeleton": 4,
}


def drawn(folder, space, parameters=(POISSON,)):
    spec = SampleSpec.model_validate(SPEC | {"space": space})
    with ThreadPoolExecutor(1) as executor:
        tables = sample(spec, Factory(parameters=parameters), folder, executor)
    return {split: as_dataset(table) for split, table in tables.items()}


def test_rows_are_the_designs_of_other_spaces_at_rest(tmp_path):
    rest, pulled = (drawn(tmp_path / space, space) for space in ("rest", "displacement"))
    for split in ("train", "test"):
        np.testing.assert_array_equal(rest[split].p, pulled[split].p)
        np.testing.assert_allclose(rest[split].delta_a, 0.0, atol=1e-9)
        np.testing.assert_allclose(rest[split].lambda_a, 0.0, atol=1e-9)
        assert pulled[split].delta_a.max() > 1.0


def test_without_sampled_parameters_there_is_nothing_to_draw(tmp_path):
    with pytest.raises(SpecError, match="space: rest without sampled parameters is one state of scene 'synthetic'"):
        drawn(tmp_path, "rest", ())


@pytest.mark.parametrize(
    "more", [{"until": {"error": "1 mm"}}, {"contact": {"translation": {"mm": [[0, 1]] * 3}, "force": "5 N"}}]
)
def test_it_goes_with_nothing_that_draws_actuation(more):
    with pytest.raises(ValidationError, match="space: rest does not go with"):
        SampleSpec.model_validate(SPEC | {"space": "rest"} | more)


def test_finite_elements_take_a_factorisation_a_row(tmp_path):
    pipeline = shutil.copytree(Path(__file__).parents[2] / "pipelines" / "bar", tmp_path / "pipelines" / "bar")
    make_mesh(pipeline / "scene.yaml", [], None, Options(quiet=True))
    changes = ["space=rest", "skeleton=2", "splits={train: {rows: 5, method: random, seed: 1}}"]
    changes.append("parameters={nu: {key: material.poisson, range: [0.40, 0.49]}}")
    run(pipeline / "sample.yaml", changes, tmp_path / "rest", Options(quiet=True), workers=1)
    rows = read_dataset(tmp_path / "rest" / "train.parquet")
    assert rows.cost["factorizations"].tolist().count(1) >= 4 and rows.cost["factorizations"].max() <= 2
    assert (rows.lambda_a == 0).all() and np.abs(rows.delta_free).max() < 1e-9
    W = rows.W[np.argsort(rows.p[:, 0])][:, rows.rows.a, rows.rows.a].ravel()
    assert (np.diff(W) != 0).all() and (np.linalg.eigvalsh(rows.W) > 0).all()
