"""Tables of text: what is written is what is read, and what could be two numbers is none."""

import csv
import io

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from cfem.core.errors import InputError
from cfem.core.text_table import read_rows, title_parts, titled, write_rows

MANY = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
NUMBERS = st.lists(
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3), min_size=1, max_size=6
)


def table(tmp_path, text, mode="w"):
    path = tmp_path / "given.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return titled(path, read_rows(path))


@MANY
@given(NUMBERS, st.sampled_from(",;\t"), st.sampled_from(["\n", "\r\n", "\r"]))
def test_numbers_come_back_bit_by_bit(tmp_path, values, mark, end):
    lines = ["a [mm]", "b [mm]", "c [mm]"], *([repr(one) for one in row] for row in values)
    found = table(tmp_path, end.join(mark.join(line) for line in lines) + end)
    np.testing.assert_array_equal(found.numbers([0, 1, 2]), values)


@MANY
@given(st.lists(st.floats(-1e6, 1e6).map(lambda one: round(one, 2)), min_size=1, max_size=8))
def test_decimal_commas_are_read_or_refused_and_never_taken_for_thousands(tmp_path, values):
    text = "a;b\n" + "".join(f"{one:.2f};7\n".replace(".", ",") for one in values)
    np.testing.assert_array_equal(table(tmp_path, text).numbers([0, 1])[:, 0], values)


@MANY
@given(st.lists(st.integers(1000, 10**9), min_size=1, max_size=8), st.sampled_from([",", ";", "\t"]))
def test_thousands_are_refused(tmp_path, values, mark):
    text = f"a{mark}b\n" + "".join(f'"{one:,}"{mark}0.5\n' for one in values)
    with pytest.raises(InputError, match=r"given.csv:\d+: column 'a': '[0-9,]+' (has a comma|is not a number)"):
        table(tmp_path, text).numbers([0, 1])


@MANY
@given(st.lists(st.lists(st.text(max_size=6), min_size=2, max_size=2), max_size=5))
def test_any_text_is_read_or_refused_with_its_line(tmp_path, cells):
    text = io.StringIO()
    csv.writer(text).writerows([["a", "b"], *cells])
    try:
        found = table(tmp_path, text.getvalue().encode(errors="replace"))
        assert np.isfinite(found.numbers([0, 1])).any() or np.isnan(found.numbers([0, 1])).all()
    except InputError as error:
        assert "given.csv:" in str(error)


@MANY
@given(st.binary(max_size=60))
def test_any_bytes_are_read_or_refused(tmp_path, data):
    try:
        table(tmp_path, data)
    except InputError as error:
        assert "given.csv" in str(error)


@pytest.mark.parametrize(
    "cell", ["1_0", "0x10", "1 000", "1'000", "inf", "-1e999", "١٢", "1e", "--1", "1,2,3", "1.234,5"]
)
def test_what_is_no_number_is_refused_with_line_and_column(tmp_path, cell):
    with pytest.raises(InputError, match=r"given.csv:4: column 'b': '.*' is"):
        table(tmp_path, f'# a comment with "\na,b\n1,2\n1,"{cell}"\n').numbers([0, 1])


@pytest.mark.parametrize(
    "text, message",
    [
        ('a,b\n1,"2,730"\n', "'2,730' has a comma and may be either of two numbers"),
        ("a;b\n1,5;2,730\n1;2.5\n", "'2,730' has a comma where '2.5' has a point"),
        ("a,a\n1,2\n", "given.csv:1: two columns are called 'a'"),
        ("a,b\n1,2\n\n3\n", "given.csv:4: 1 cells, and the titles are 2"),
        ("", "is empty"),
        (b"a,b\n1,\xb5\n", "given.csv:2: is not a text file in UTF-8: byte 0xb5"),
    ],
)
def test_what_has_two_meanings_is_refused(tmp_path, text, message):
    with pytest.raises(InputError, match=message):
        table(tmp_path, text).numbers([0, 1])


def test_commas_that_are_decimal_for_certain_make_the_others_so(tmp_path):
    np.testing.assert_array_equal(
        table(tmp_path, "a;b\n0,5;2,730\n,5;-1,25e3\n").numbers([0, 1]), [[0.5, 2.73], [0.5, -1250]]
    )


def test_a_row_of_gaps_is_a_row_and_an_empty_line_is_none(tmp_path):
    found = table(tmp_path, "a,b\n1,2\n,\n\n  \n3,4\n")
    np.testing.assert_array_equal(found.numbers([0, 1]), [[1, 2], [np.nan, np.nan], [3, 4]])
    assert [row.line for row in found.rows] == [2, 3, 6]


def test_cells_of_text_keep_their_commas_and_gaps_are_nan(tmp_path):
    found = table(tmp_path, 'name,b\n"tip, left",\n1.2.3,NaN\n')
    assert found.texts("name") == ["tip, left", "1.2.3"] and np.isnan(found.numbers([1])).all()


def test_written_rows_are_read_again_to_four_decimals_and_gaps_stay_gaps(tmp_path):
    path = tmp_path / "made.csv"
    write_rows(path, ["case", "x"], [["a, or b", 1.23456], ["c", np.nan]])
    made = titled(path, read_rows(path))
    assert made.titles == ("case", "x") and made.texts("case") == ["a, or b", "c"]
    np.testing.assert_array_equal(made.numbers([1]), [[1.2346], [np.nan]])


@pytest.mark.parametrize(
    ("title", "parts"),
    [
        ("tip.x [mm]", ("tip.x", "mm")),
        (" engineering stress (MPa) ", ("engineering stress", "MPa")),
        ("strain", ("strain", "")),
        ("strain []", ("strain", "")),
        ("a [mm] b", ("a [mm] b", "")),
        ("a\nb [mm]", ("a\nb", "mm")),
    ],
)
def test_a_title_has_a_name_and_may_have_a_unit(title, parts):
    assert title_parts(title) == parts
