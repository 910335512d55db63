"""Artefacts travel to and from any file system that pyarrow reaches, here one in memory."""

import numpy as np
import pytest
from dataset.test_reader import META, ROWS, record, write_rows
from pyarrow.fs import FSSpecHandler, PyFileSystem, copy_files

from cfem.core.artefact.stage_run import Stage
from cfem.core.artefact.verify import judge
from cfem.core.stage import Options, run_stage
from cfem.dataset.reader import read_dataset
from cfem.dataset.schema import schema
from cfem.sample.spec import SampleSpec

SPEC = SampleSpec(scene="s", mesh="m", out="o", splits={"train": {"rows": 2, "method": "random"}})


@pytest.fixture
def memory():
    fsspec = pytest.importorskip("fsspec")
    return PyFileSystem(FSSpecHandler(fsspec.filesystem("memory")))


def test_a_dataset_is_read_where_it_lies_and_copied_back_whole(memory, tmp_path):
    def work(folder):
        write_rows(folder / "train.parquet", [record(0), record(2)], schema(ROWS, META))
        return {}

    out = tmp_path / "out"
    run_stage(Stage("sample", 1, SPEC, {}, out, ("scene", "mesh", "out")), work, Options(quiet=True))
    copy_files(str(out), "/bucket/samples", destination_filesystem=memory)
    with memory.open_input_file("/bucket/samples/train.parquet") as file:
        there = read_dataset(file)
    np.testing.assert_array_equal(there.W, read_dataset(out / "train.parquet").W)
    (tmp_path / "back").mkdir()
    copy_files("/bucket/samples", str(tmp_path / "back"), source_filesystem=memory)
    assert judge(tmp_path / "back").damage == ()
    assert (tmp_path / "back" / "manifest.json").read_bytes() == (out / "manifest.json").read_bytes()
