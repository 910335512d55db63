"""Tables of measured numbers: what is written in any unit and format is read in the system's, and errors say where."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cfem.core.errors import InputError
from cfem.dataset.tables import read_table

UNITS = {"tip.x": "mm", "cable.force": "N", "chamber.force": "MPa"}
SIZES = {
    "tip.x": {"mm": 1.0, "m": 1e3},
    "cable.force": {"N": 1.0, "kN": 1e3},
    "chamber.force": {"kPa": 1e-3, "MPa": 1.0},
}
NUMBERS = st.lists(st.none() | st.floats(-1e6, 1e6), min_size=3, max_size=3)
NAMES = list(UNITS)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(NUMBERS, min_size=1, max_size=5), st.tuples(*(st.sampled_from(sorted(SIZES[name])) for name in NAMES)))
def test_the_formats_agree(tmp_path, rows, units):
    titles = [f"{name} [{unit}]" for name, unit in zip(NAMES, units, strict=True)]
    text = [["" if one is None else repr(one) for one in row] for row in rows]
    (tmp_path / "t.csv").write_text("".join(",".join(line) + "\n" for line in [titles, *text]))
    pq.write_table(
        pa.table({title: pa.array([row[i] for row in rows], pa.float64()) for i, title in enumerate(titles)}),
        tmp_path / "t.parquet",
    )
    states = [
        ", ".join(
            f"{name}: {one!r} {unit}" for name, unit, one in zip(NAMES, units, row, strict=True) if one is not None
        )
        for row in rows
    ]
    (tmp_path / "t.yaml").write_text("".join(f"- {{{state}}}\n" for state in states))
    expected = np.array([[np.nan if one is None else one for one in row] for row in rows], float)
    expected *= [SIZES[name][unit] for name, unit in zip(NAMES, units, strict=True)]
    for suffix in ("csv", "parquet", "yaml"):
        table = read_table(tmp_path / f"t.{suffix}", UNITS)
        assert len(table) == len(rows) and all(f"t.{suffix}" in place for place in table.places)
        for i, name in enumerate(NAMES):
            found = table.columns.get(name, np.full(len(rows), np.nan))
            np.testing.assert_allclose(found, expected[:, i], rtol=1e-15)


def test_places_are_lines_of_the_file(tmp_path):
    (tmp_path / "t.csv").write_text("# a comment\ntip.x [mm]\n\n1\n2\n")
    assert [place.rsplit(":", 1)[1] for place in read_table(tmp_path / "t.csv", UNITS).places] == ["4", "5"]


@pytest.mark.parametrize(
    "text, message",
    [
        ("tip.x [mm]\n1_0\n", r"t.csv:2: column 'tip.x .mm.': '1_0' is not a number"),
        ('tip.x [mm],cable.force [N]\n"2,730",1.5\n', r"t.csv:2: column 'tip.x .mm.': '2,730' has a comma where '1.5'"),
        ("tip.x [mm],tip.x [m]\n1,2\n", "column 'tip.x' appears twice"),
        ("tip.x [N]\n1\n", "'N' is not a unit of length"),
        ("tap.x [mm]\n1\n", "column 'tap.x': expected one of tip.x"),
    ],
)
def test_what_could_be_two_numbers_is_refused(tmp_path, text, message):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_table(tmp_path / "t.csv", UNITS)


@pytest.mark.parametrize("values", [["1"], [True], [np.inf]])
def test_a_parquet_column_holds_finite_numbers(tmp_path, values):
    pq.write_table(pa.table({"tip.x [mm]": values}), tmp_path / "t.parquet")
    with pytest.raises(InputError, match=r"t.parquet: row 1: 'tip.x': .* is not a finite number"):
        read_table(tmp_path / "t.parquet", UNITS)


def test_columns_are_stacked_in_the_order_that_is_asked_for_and_absent_ones_are_gaps(tmp_path):
    (tmp_path / "t.csv").write_text("tip.x [m],cable.force [N]\n0.001,2\n,3\n")
    stacked = read_table(tmp_path / "t.csv", UNITS).stack(["cable.force", "chamber.force", "tip.x"])
    np.testing.assert_allclose(stacked, [[2.0, np.nan, 1.0], [3.0, np.nan, np.nan]])
