import json

import numpy as np
import pyarrow.parquet as pq

from cfem.dataset.writer import write_columns, write_records


def test_results_are_columns_of_numbers_texts_and_vectors(tmp_path):
    rows = [{"name": "a", "x": np.array([1.0, 2.0]), "t": 1}, {"name": "b", "x": np.array([3.0, np.nan]), "t": 2}]
    write_records(tmp_path / "rows.parquet", rows, {"units": {"x": "mm"}})
    write_columns(tmp_path / "columns.parquet", {"W": np.arange(6.0).reshape(3, 2).T}, {})
    table = pq.read_table(tmp_path / "rows.parquet")
    assert table["name"].to_pylist() == ["a", "b"] and table["t"].to_pylist() == [1, 2]
    assert table["x"][0].as_py() == [1.0, 2.0] and np.isnan(table["x"][1].as_py()[1])
    assert table.schema.field("x").type.list_size == 2
    assert json.loads(table.schema.metadata[b"cfem"]) == {"units": {"x": "mm"}}
    assert pq.read_table(tmp_path / "columns.parquet")["W"].to_pylist() == [[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]]
