"""What is written is what is read, by us and by others; what is damaged is said to be."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cfem.condensed import Rows, pack_upper
from cfem.core.errors import InputError
from cfem.dataset.reader import read_dataset, read_table
from cfem.dataset.schema import schema
from cfem.dataset.writer import content_hash, write_rows

ROWS = Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))
META = {
    "scene": "made-up",
    "rest_e": [0.0, 1.0, 2.0],
    "reach": [[0.0, 1.0]] * 2,
    "length": 10.0,
    "versions": {"cfem": "0"},
}


def record(i: int, converged: bool = True, seconds: float = 0.1) -> dict:
    rng = np.random.default_rng(i)
    row = {"id": i, "split": "train", "status": "converged" if converged else "singular", "u": rng.random(2)}
    row |= {"reason": "" if converged else "the tangent is singular", "residual": 1e-12, "seconds": seconds}
    row |= {"iterations": 3, "factorizations": 1, "steps": 1}
    if converged:
        W = rng.random((5, 5))
        row |= {"W": pack_upper(W + W.T), "energy": rng.random(), "slack": np.array([False, True])}
        row |= {name: rng.random(size) for name, size in dict(delta_a=2, delta_e=3, lambda_a=2, delta_free=5).items()}
    return row


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "train.parquet"
    write_rows(path, [record(0), record(1, converged=False), record(2)], schema(ROWS, META))
    return path


def test_converged_rows_come_back_bit_for_bit_and_failed_ones_with_their_reason(file):
    dataset = read_dataset(file)
    assert dataset.rows == ROWS and len(dataset) == 2 and dataset.meta["rest_e"] == META["rest_e"]
    np.testing.assert_array_equal(dataset.id, [0, 2])
    for index, i in enumerate((0, 2)):
        for name in ("u", "delta_a", "delta_e", "lambda_a", "delta_free", "energy", "slack"):
            np.testing.assert_array_equal(getattr(dataset, name)[index], record(i)[name])
        np.testing.assert_array_equal(pack_upper(dataset.W[index]), record(i)["W"])
        np.testing.assert_array_equal(dataset.W[index], dataset.W[index].T)
    assert dataset.failed["reason"].to_pylist() == ["the tangent is singular"]
    assert dataset.failed["W"].null_count == 1


def test_every_column_of_numbers_states_its_unit(file):
    units = read_dataset(file).meta["units"]
    assert units["W"] == "mm/N" and units["delta_free"] == "mm" and units["energy"] == "N mm" and units["u"] == "1"


def test_a_file_with_failed_rows_only_has_empty_arrays_of_the_right_shape(tmp_path):
    write_rows(tmp_path / "x.parquet", [record(0, converged=False)], schema(ROWS, META))
    dataset = read_dataset(tmp_path / "x.parquet")
    assert dataset.W.shape == (0, 5, 5) and dataset.delta_e.shape == (0, 3) and len(dataset.failed) == 1


@pytest.mark.parametrize("reader", ["pandas", "polars", "duckdb"])
def test_others_read_it_without_us(file, reader):
    expected = [record(0)["lambda_a"].tolist(), None, record(2)["lambda_a"].tolist()]
    if reader == "duckdb":
        import duckdb

        rows = duckdb.sql(f"select lambda_a from '{file}' order by id").fetchall()
        found = [row[0] for row in rows]
    elif reader == "polars":
        import polars

        found = polars.read_parquet(file)["lambda_a"].to_list()
    else:
        import pandas

        found = list(pandas.read_parquet(file)["lambda_a"])
    assert [None if row is None else list(row) for row in found] == expected


@pytest.mark.parametrize("part", np.linspace(0.02, 0.99, 12))
def test_a_flipped_byte_is_an_error_that_names_the_file_or_changes_nothing(file, part):
    whole, data = read_table(file), bytearray(file.read_bytes())
    data[int(part * len(data))] ^= 0x55
    file.write_bytes(data)
    try:
        assert read_table(file).equals(whole)
    except InputError as error:
        assert str(file) in str(error)


@pytest.mark.parametrize("size", [0, 3, 400])
def test_a_cut_file_is_an_error(file, size):
    file.write_bytes(file.read_bytes()[:size])
    with pytest.raises(InputError, match=r"train\.parquet: is damaged"):
        read_dataset(file)


def test_missing_and_foreign_files_are_errors(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_dataset(tmp_path / "none.parquet")
    pq.write_table(pa.table({"a": [1]}), tmp_path / "foreign.parquet")
    with pytest.raises(InputError, match="no dataset of cfem"):
        read_dataset(tmp_path / "foreign.parquet")


def test_the_content_hash_sees_values_and_meaning_but_neither_time_nor_versions(tmp_path):
    def digest(seconds=0.1, first=0, **meta):
        path = tmp_path / "x.parquet"
        write_rows(path, [record(first, seconds=seconds), record(5, converged=False)], schema(ROWS, META | meta))
        return content_hash({"train": read_table(path)})

    assert digest() == digest(seconds=9.0) == digest(versions={"cfem": "1"})
    assert len({digest(), digest(first=1), digest(length=11.0)}) == 3
