"""Flipped bits and cut files: `cfem verify` sees all, and what reads them says one sentence."""

import os
import random
import shutil
from pathlib import Path

import numpy as np
import pytest
from faults.sampling import make
from surrogate.stored import train_folder
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.manifest import MANIFEST
from cfem.core.artefact.verify import judge
from cfem.core.errors import CfemError
from cfem.dataset.inspect import describe
from cfem.dataset.reader import read_dataset, read_table
from cfem.predict.load import load_model


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A dataset, and a model trained from another."""
    root = tmp_path_factory.mktemp("damage")
    train_folder(root, "{kind: spectral, max_degree: 2}")
    make(root / "dataset")
    return root


def harms(files: list[Path], flips: int, cuts: int):
    """(file, bytes that it has then), evenly over the files, at random places."""
    chance = random.Random(flips)
    for number in range(flips + cuts):
        file = files[number % len(files)]
        data = bytearray(file.read_bytes())
        if number < flips:
            bit = chance.randrange(8 * len(data))
            data[bit // 8] ^= 1 << bit % 8
        else:
            del data[chance.randrange(len(data)) :]
        yield file, bytes(data)


def read_all(dataset: Path, model: Path) -> None:
    """What `train`, `report` and `inspect` do with a dataset, `export` and `control` with a model."""
    for split in ("train", "test"):
        read_dataset(artefact_file(dataset, f"{split}.parquet"))
    describe(dataset)
    load_model(model)
    artefact_file(model, "test_vectors.npz")


@pytest.mark.parametrize("flips, cuts", [(20, 8), pytest.param(1000, 200, marks=pytest.mark.slow)])
def test_all_damage_is_found_by_verify_and_by_what_reads(folder, flips, cuts):
    dataset, model = folder / "dataset", folder / "model"
    files = [path for one in (dataset, model) for path in sorted(one.rglob("*")) if path.is_file()]
    assert {file.suffix for file in files} >= {".parquet", ".json", ".npz"}
    by_verify = by_reading = 0
    for file, harmed in harms(files, flips, cuts):
        whole = file.read_bytes()
        file.write_bytes(harmed)
        found = [sentence for one in (dataset, model) for sentence in judge(one).damage]
        by_verify += len(found) == 1 and str(file) in found[0]
        try:
            read_all(dataset, model)
        except CfemError as error:
            by_reading += error.exit_code == 3 and file.name in str(error)
        file.write_bytes(whole)
    assert (by_verify, by_reading) == (flips + cuts, flips + cuts)
    assert not judge(dataset).damage and not judge(model).damage
    print(f"{flips} flips and {cuts} cuts of {len(files)} files: all found")


@pytest.mark.parametrize("flips, cuts", [(20, 7), pytest.param(3000, 500, marks=pytest.mark.slow)])
def test_a_damaged_parquet_file_alone_is_read_or_refused_but_never_crashes(folder, tmp_path, flips, cuts):
    """Without its manifest there are the checksums of its pages, which do not cover its metadata."""
    source, file = folder / "dataset" / "train.parquet", tmp_path / "train.parquet"
    truth = read_dataset(source)
    refused = 0
    for _, harmed in harms([source], flips, cuts):
        file.write_bytes(harmed)
        try:
            read_table(file)
            found = read_dataset(file)
            if len(found) == len(truth) and found.W.shape == truth.W.shape:
                np.testing.assert_array_equal(found.W, truth.W)
        except CfemError as error:
            refused += 1
            assert error.exit_code == 3
    print(f"{refused} of {flips + cuts} refused")
    assert refused > 0.5 * (flips + cuts)


def test_commands_end_with_3_and_one_line(folder, tmp_path):
    for name in ("samples", "model", "train.yaml"):
        source = folder / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    (tmp_path / "export.yaml").write_text("model: model\nout: exported\n")
    damaged = {
        tmp_path / "samples" / "train.parquet": ["train", tmp_path / "train.yaml", "--force"],
        tmp_path / "samples" / MANIFEST: ["train", tmp_path / "train.yaml"],
        tmp_path / "model" / "weights.npz": ["export", tmp_path / "export.yaml"],
        tmp_path / "model" / "model.json": ["export", tmp_path / "export.yaml"],
        tmp_path / "model" / MANIFEST: ["inspect", tmp_path / "model"],
    }
    for file, words in damaged.items():
        whole = file.read_bytes()
        os.truncate(file, len(whole) // 2)
        result = CliRunner().invoke(app, [*map(str, words), *(["--quiet"] if words[0] != "inspect" else [])])
        assert result.exit_code == 3, (file, result.stderr)
        assert len(result.stderr.strip().splitlines()) == 1 and file.name in result.stderr
        file.write_bytes(whole)
