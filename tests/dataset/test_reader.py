"""What is written is what is read, by us and by others; what is damaged is said to be."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cfem.condensed import Rows, pack_upper
from cfem.condensed.parameters import Parameter
from cfem.core.errors import InputError
from cfem.dataset.reader import read_dataset, read_table
from cfem.dataset.schema import KEY, metadata, schema
from cfem.dataset.writer import content_hash, write_table

ROWS = Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))
META = {
    "scene": "made-up",
    "rest_e": [0.0, 1.0, 2.0],
    "reach": [[0.0, 1.0]] * 2,
    "length": 10.0,
    "versions": {"cfem": "0"},
}

POISSON = Parameter("nu", "material.poisson", "1", 0.4, 0.49, 0.45, "log(1-2p)")
RADIUS = Parameter("guide", "actuators.0.radius", "mm", 1.0, 3.0, 2.0)
YOUNG = Parameter("E", "material.young", "MPa", 1.0, 10.0, 3.0, "log", exact=True)


def record(i: int, converged: bool = True, seconds: float = 0.1) -> dict:
    rng = np.random.default_rng(i)
    row = {"id": i, "split": "train", "status": "converged" if converged else "singular", "u": rng.random(2)}
    row |= {
        "reason": "" if converged else "the tangent is singular",
        "residual": 1e-12,
        "tolerance": 1e-10,
        "seconds": seconds,
    }
    row |= {"iterations": 3, "factorizations": 1, "steps": 1}
    if converged:
        W = rng.random((5, 5))
        row |= {"W": pack_upper(W + W.T), "energy": rng.random(), "slack": np.array([False, True])}
        row |= {name: rng.random(size) for name, size in dict(delta_a=2, delta_e=3, lambda_a=2, delta_free=5).items()}
    return row


def full_record(i: int, converged: bool = True) -> dict:
    """With third order and two sampled parameters."""
    rng = np.random.default_rng(100 + i)
    row = record(i, converged) | {"u": rng.random(4), "p": rng.uniform([0.4, 1.0], [0.49, 3.0])}
    if converged:
        dW = rng.random((2, 5, 5))
        row |= {"dW": pack_upper(dW + dW.transpose(0, 2, 1)).ravel(), "dpsi_dp": rng.random(2)}
        row |= {"dlambda_dp": rng.random(4), "ddelta_e_dp": rng.random(6)}
    return row


def write_rows(path, records, of):
    write_table(path, pa.Table.from_pylist(records, schema=of))


@pytest.fixture
def full(tmp_path):
    path = tmp_path / "full.parquet"
    records = [full_record(0), full_record(1, converged=False), full_record(2), full_record(3)]
    write_rows(path, records, schema(ROWS, META, (POISSON, YOUNG, RADIUS), third_order=True))
    return path


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


def test_parameters_and_third_order_come_back_where_a_dataset_has_them(file, full):
    plain, dataset = read_dataset(file), read_dataset(full)
    assert (
        plain.p.shape == (2, 0)
        and plain.dW is None
        and plain.dpsi_dp is None
        and plain.dlambda_dp is None
        and plain.parameters == ()
    )
    assert not {"p", "dW", "dpsi_dp", "dlambda_dp", "ddelta_e_dp"} & {
        *read_table(file).column_names,
        *plain.meta["units"],
    }
    assert dataset.parameters == (POISSON, RADIUS) and len(dataset.meta["parameters"]) == 3
    for index, i in enumerate((0, 2, 3)):
        np.testing.assert_array_equal(dataset.p[index], full_record(i)["p"])
        np.testing.assert_array_equal(dataset.dpsi_dp[index], full_record(i)["dpsi_dp"])
        np.testing.assert_array_equal(dataset.dlambda_dp[index].ravel(), full_record(i)["dlambda_dp"])
        np.testing.assert_array_equal(dataset.ddelta_e_dp[index].ravel(), full_record(i)["ddelta_e_dp"])
        np.testing.assert_array_equal(pack_upper(dataset.dW[index]).ravel(), full_record(i)["dW"])
    np.testing.assert_array_equal(dataset.dW, dataset.dW.swapaxes(2, 3))
    units = dataset.meta["units"]
    assert units["p"] == ["1", "mm"] and units["dpsi_dp"] == ["N mm", "N mm/mm"] and units["dW"] == "mm/N^2"
    assert units["dlambda_dp"] == ["N", "N/mm"] * 2 and units["ddelta_e_dp"] == ["mm", "mm/mm"] * 3


@pytest.mark.parametrize("index", [np.array([2, 0]), slice(2), np.array([False, True, True])])
def test_taking_rows_takes_them_of_every_field(full, index):
    whole = read_dataset(full)
    part = whole.take(index)
    for name in (
        "id",
        "u",
        "p",
        "delta_a",
        "delta_e",
        "lambda_a",
        "W",
        "delta_free",
        "energy",
        "slack",
        "dW",
        "dpsi_dp",
        "dlambda_dp",
        "ddelta_e_dp",
    ):
        np.testing.assert_array_equal(getattr(part, name), getattr(whole, name)[index])
    np.testing.assert_array_equal(part.cost["residual"], whole.cost["residual"][index])
    assert len(part) == 2 and part.rows == whole.rows and part.failed is whole.failed


def test_taking_rows_keeps_what_is_not_there_away(file):
    part = read_dataset(file).take(np.array([1]))
    assert part.dW is None and part.dpsi_dp is None and part.p.shape == (1, 0)


def test_the_rows_of_a_chamber_and_of_an_orientation_state_units_of_their_own():
    rows = Rows(("tip.x", "tip.rx"), ("chamber", "cable"))
    row_units = [("mm", "N"), ("rad", "N mm"), ("mm^3", "MPa"), ("mm", "N")]
    units = metadata(schema(rows, META, (), True, row_units).empty_table())["units"]
    assert units["delta_e"] == ["mm", "rad"] and units["lambda_a"] == ["MPa", "N"]
    assert units["W"][2] == "mm/MPa" and units["W"][5] == "rad/MPa"
    assert units["dW"][2] == "mm/MPa/MPa" and len(units["dW"]) == 20


def test_a_file_of_an_older_format_says_so(file):
    table = read_table(file)
    meta = metadata(table) | {"format": 1}
    pq.write_table(table.replace_schema_metadata({KEY: json.dumps(meta)}), file, write_page_checksum=True)
    with pytest.raises(InputError, match="has format 1; this cfem reads 3"):
        read_dataset(file)


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
    with pytest.raises(InputError, match="not a dataset of cfem"):
        read_dataset(tmp_path / "foreign.parquet")


def test_the_content_hash_sees_values_and_meaning_but_neither_time_nor_versions(tmp_path):
    def digest(seconds=0.1, first=0, **meta):
        path = tmp_path / "x.parquet"
        write_rows(path, [record(first, seconds=seconds), record(5, converged=False)], schema(ROWS, META | meta))
        return content_hash({"train": read_table(path)})

    assert digest() == digest(seconds=9.0) == digest(versions={"cfem": "1"})
    assert len({digest(), digest(first=1), digest(length=11.0)}) == 3
