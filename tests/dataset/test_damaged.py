"""A Parquet file that is whole and yet no dataset: one sentence, whatever is wrong with it."""

import json

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from surrogate.stored import store_dataset

from cfem.core.errors import InputError
from cfem.dataset.reader import read_dataset
from cfem.dataset.schema import KEY


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    return pq.read_table(store_dataset(tmp_path_factory.mktemp("stored") / "samples") / "test.parquet")


def column(table, name, values):
    return table.set_column(table.column_names.index(name), name, values)


def meta(table, change):
    data = change(json.loads(table.schema.metadata[KEY]))
    return table.replace_schema_metadata({KEY: json.dumps(data).encode()})


def lists(table, size):
    return pa.FixedSizeListArray.from_arrays(pa.array([1.0] * size * len(table)), size)


HARMS = {
    "metadata that is a list": (lambda t: meta(t, lambda data: [data]), "its metadata is not a JSON object"),
    "metadata that is no JSON": (lambda t: t.replace_schema_metadata({KEY: b"{"}), "is damaged"),
    "another format": (lambda t: meta(t, lambda data: data | {"format": 99}), "has format 99"),
    "rows without names": (
        lambda t: meta(t, lambda data: data | {"rows": {}}),
        "rows.effectors: Field required",
    ),
    "no units": (lambda t: meta(t, lambda data: {k: data[k] for k in data if k != "units"}), "units: Field required"),
    "a column too few": (lambda t: t.drop_columns(["W"]), "column 'W' is missing"),
    "lists of any length": (lambda t: column(t, "W", pa.array(t["W"].to_pylist())), "column 'W' is of type list"),
    "text for numbers": (lambda t: column(t, "energy", pa.array(["1"] * len(t))), "column 'energy' is of type string"),
    "a matrix that is none": (
        lambda t: column(t, "W", lists(t, 7)),
        r"'W' is of type \S+ double>\[7\]",
    ),
}


@pytest.mark.parametrize("harm", HARMS)
def test_it_is_refused(stored, tmp_path, harm):
    change, why = HARMS[harm]
    pq.write_table(change(stored), tmp_path / "x.parquet")
    with pytest.raises(InputError, match=why) as refused:
        read_dataset(tmp_path / "x.parquet")
    assert "x.parquet" in str(refused.value) and len(str(refused.value).splitlines()) == 1


def test_derivatives_by_parameters_come_together(tmp_path):
    """A dataset of before the multipliers' and effectors' ones were stored is refused, not half read."""
    whole = pq.read_table(store_dataset(tmp_path / "samples", parameters=True) / "test.parquet")
    pq.write_table(whole, tmp_path / "x.parquet")
    assert read_dataset(tmp_path / "x.parquet").dlambda_dp is not None
    pq.write_table(whole.drop_columns(["dlambda_dp", "ddelta_e_dp"]), tmp_path / "x.parquet")
    with pytest.raises(InputError, match="column 'dlambda_dp' is missing"):
        read_dataset(tmp_path / "x.parquet")


def test_the_one_that_is_not_harmed_is_read(stored, tmp_path):
    pq.write_table(stored, tmp_path / "x.parquet")
    assert len(read_dataset(tmp_path / "x.parquet")) == len(stored)
