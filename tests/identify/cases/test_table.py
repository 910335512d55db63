"""What a table of load cases says twice, or in two ways, is refused with its line and column."""

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.identify.cases.spec import ForceColumn, TableColumns
from cfem.identify.cases.table import read_cases

HEAD = "case,load_N,marker,x,y,z,up"
ROWS = [
    "a,1.5,tip,100,0,0,0",
    "a,1.5,base,10,0,0,0",
    "b,2,tip,90,0,-30,0",
    "b,2,base,10,0,0,0",
    "c,3,tip,80,0,-40,1",
    "c,3,base,10,0,0,1",
]
LAYOUT = TableColumns(
    case=["case"], position=["x", "y", "z"], forces={"cable": ForceColumn(column="load_N", unit="N")}, unloading="up"
)


def read(tmp_path, rows=ROWS, head=HEAD, layout=LAYOUT, measured=True):
    (tmp_path / "given.csv").write_text("\n".join([head, *rows]) + "\n")
    return read_cases(tmp_path / "given.csv", layout, ["tip", "base"], ["cable"], ["N"], 120.0, measured)


def test_a_table_is_read(tmp_path):
    cases = read(tmp_path)
    assert cases.names == ("a", "b", "c") and cases.forces.tolist() == [[1.5], [2.0], [3.0]]
    assert cases.directions.tolist() == [1.0, 1.0, -1.0]
    np.testing.assert_array_equal(cases.places[1], [[90, 0, -30], [10, 0, 0]])


def test_a_force_may_stand_in_the_first_row_of_a_case_alone(tmp_path):
    rows = [row if "tip" in row else row.replace(row.split(",")[1], "", 1) for row in ROWS]
    assert read(tmp_path, rows).forces.tolist() == [[1.5], [2.0], [3.0]]


def test_two_columns_name_a_session(tmp_path):
    layout = LAYOUT.model_copy(update={"session": ["load_N", "up"]})
    assert read(tmp_path, layout=layout).sessions == ("1.5 0", "2 0", "3 1")
    assert read(tmp_path).sessions == ("", "", "")


def test_rows_of_separators_alone_end_no_table(tmp_path):
    assert len(read(tmp_path, [*ROWS, ",,,,,,", "", ",,,,,,"])) == 3


def test_markers_that_nobody_names_are_ignored(tmp_path):
    assert len(read(tmp_path, [*ROWS, *(f"{case},{f},other,1,1,1,0" for case, f in (("a", 1.5), ("b", 2), ("c", 3)))]))


MISTAKES = {
    "two forces in one case": (
        "b,2,base",
        "b,2.5,base",
        r"csv:5: column 'load_N': is 2.5, and 2 in line 4 of the same",
    ),
    "digits with underscores": ("a,1.5,tip", "a,1_0,tip", r"csv:2: column 'load_N': '1_0' is not a number"),
    "thousands": ("c,3,tip,80,", 'c,3,tip,"2,730",', r"csv:6: column 'x': '2,730' has a comma where '1.5' has a point"),
    "one row in metres": (
        "b,2,tip,90,0,-30",
        "b,2,tip,0.09,0,-0.03",
        r"csv:4: column 'x': marker 'tip' .* another unit",
    ),
    "a marker misspelt": ("b,2,tip", "b,2,tpi", r"csv:4: marker 'tpi' is none of tip, base, and this case lacks tip"),
    "no force": ("a,1.5", "a,", r"csv:2: column 'load_N': is empty"),
    "infinite": ("b,2,tip,90", "b,2,tip,inf", r"csv:4: column 'x': 'inf' is not a number"),
    "neither loading nor unloading": ("80,0,-40,1", "80,0,-40,down", r"csv:6: column 'up': 'down' is neither 1 nor 0"),
    "a cell too few": ("c,3,tip,80,0,-40,1", "c,3,tip,80,0,-40", r"csv:6: 6 cells, and the titles are 7"),
    "twice the same marker": ("a,1.5,base", "a,1.5,tip", r"csv:3: marker 'tip' appears twice in case a"),
    "a quote that never ends": ("c,3,tip", 'c,3,"tip', r"csv:\d+: is not a table .* unexpected end"),
}


@pytest.mark.parametrize("old, new, message", MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_told_with_its_line_and_column(tmp_path, old, new, message):
    text = "\n".join(ROWS)
    assert old in text
    with pytest.raises(InputError, match=message):
        read(tmp_path, text.replace(old, new).splitlines())


def test_a_marker_that_no_case_has_is_told(tmp_path):
    with pytest.raises(InputError, match="csv: holds no marker 'tip'; it has TIP, base"):
        read(tmp_path, [row.replace("tip", "TIP") for row in ROWS])
    assert len(read(tmp_path, [row for row in ROWS if "tip" in row], measured=False)) == 3  # cases to predict


def test_a_title_that_stands_twice_is_refused(tmp_path):
    with pytest.raises(InputError, match="csv:1: two columns are called 'x'"):
        read(tmp_path, head=HEAD.replace("y", "x"))
    with pytest.raises(InputError, match="has no column 'y', only case"):
        read(tmp_path, head=HEAD.replace("y", "Y"))
