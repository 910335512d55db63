"""Tables of spreadsheets whose decimals have a comma."""

import io

import pytest

from cfem.core.semicolons import read_rows, with_point

POINTS = [["load [N]", "name"], ["0.5", "tip, left"], ["-1.25e3", "1.2.3"]]


@pytest.mark.parametrize(
    "text",
    [
        'load [N],name\n0.5,"tip, left"\n-1.25e3,1.2.3\n',
        "load [N];name\n0,5;tip, left\n-1,25e3;1.2.3\n",
        "load [N]; name\r\n0.5; tip, left\r\n-1,25e3; 1.2.3\r\n",
    ],
)
def test_semicolons_make_commas_points(text):
    assert list(read_rows(io.StringIO(text, newline=""))) == POINTS


def test_only_a_number_has_a_decimal_comma():
    assert [with_point(cell) for cell in ("0,5", ",5", "1,2,3", "a,5", "-7", "")] == [
        "0.5",
        ".5",
        "1,2,3",
        "a,5",
        "-7",
        "",
    ]
