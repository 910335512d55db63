import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cfem.core.units import parse_array, parse_number, parse_quantity


@pytest.mark.parametrize(
    "text, unit, value",
    [
        ("3000 kPa", "MPa", 3.0),
        ("3e6 Pa", "MPa", 3.0),
        ("4 cm", "mm", 40.0),
        ("1e-3 m", "mm", 1.0),
        ("500 mN", "N", 0.5),
        ("180 deg", "rad", np.pi),
        ("-3 mm", "mm", -3.0),
        ("1070 kg/m^3", "t/mm^3", 1.07e-9),
        ("9.81 m/s^2", "mm/s^2", 9810.0),
        ("2 ml", "mm^3", 2000.0),
        ("1 inch^3", "mm^3", 25.4**3),
        ("1MPa", "MPa", 1.0),
        ("9mm", "mm", 9.0),
        (" 5e-2mm ", "mm", 0.05),
        ("1E+1um", "mm", 0.01),
        ("2N/mm^2", "MPa", 2.0),
        ("2 N / mm**2", "MPa", 2.0),
        ("3 N*m^-1*mm^-1", "MPa", 3e-3),
        ("1.5 degree", "rad", np.pi / 120),
    ],
)
def test_units_are_converted(text, unit, value):
    assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    "text",
    ["3 kPa", "3", "mm", "3mmm", "3 furlongish", "nan mm", "inf mm", "", 3, 3.0, True, None, "1 mm; 2 mm"]
    + ["60 mm*9**9**9**9", "60 mm*pi", "60 mm*2", "2 * 30 mm", "60 mm*(1)", "60 mm/percent", "60 mm*rad", "3 mm mm/mm"]
    + ["1_0 mm", "1e3e4 mm", "1,5 mm", "60 mm^99", "60 (mm)", "60 mm+mm", "60 " + "mm*mm/" * 99 + "mm", "0x10 mm"],
)
def test_whatever_is_no_length_is_refused_by_name(text):
    with pytest.raises(ValueError, match=r"length|unit"):
        parse_quantity(text, "mm")


@given(value=st.floats(-1e6, 1e6), unit=st.sampled_from(["um", "mm", "cm", "m"]))
def test_scale_is_that_of_the_unit(value, unit):
    factor = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1000.0}[unit]
    assert parse_quantity(f"{value!r} {unit}", "mm") == pytest.approx(value * factor, rel=1e-12, abs=1e-15)


def test_arrays_are_converted_and_read_only():
    array = parse_array({"cm": [[1, 2, 3]]}, "mm", 2)
    np.testing.assert_array_equal(array, [[10, 20, 30]])
    with pytest.raises(ValueError, match="read-only"):
        array[0, 0] = 1


def test_examples_are_in_units_that_people_write():
    with pytest.raises(ValueError, match=r"density with its unit, such as '1 kg/m\^3'"):
        parse_quantity(1070, "t/mm^3")
    with pytest.raises(ValueError, match=r"got '1,5 MPa' \(decimals have a point, not a comma\)"):
        parse_quantity("1,5 MPa", "MPa")
    with pytest.raises(ValueError, match=r"expected an angle with its unit, such as '1 deg'"):
        parse_quantity(30, "rad")
    with pytest.raises(ValueError, match=r"acceleration; expected e\.g\. m/s\^2"):
        parse_array({"kg": [0, 0, 1]}, "mm/s^2", 1, 3)


@pytest.mark.parametrize(
    "data",
    [[1, 2, 3], {"kPa": [1]}, {"mm": [[1, 2], [3]]}, {"mm": []}, {"mm": ["a"]}, {"mm": [[1]]}, {"mm": [1], "cm": [1]}],
)
def test_arrays_of_other_shape_or_unit_are_refused(data):
    with pytest.raises(ValueError, match=r"expected|not a unit"):
        parse_array(data, "mm", 1)


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ([[1, 2, 3], [4, 5]], "as many in each row, got rows of 2 and 3"),
        ([[1, 2, "x"]], "got 'x'"),
        ([], r"a list of rows, \[\[1, 2\], \[3, 4\]\], under 'mm', got nothing"),
        ([1, 2], "got a list of numbers"),
    ],
)
def test_what_is_wrong_with_an_array_is_said(numbers, words):
    with pytest.raises(ValueError, match=words):
        parse_array({"mm": numbers}, "mm", 2)


def test_the_usual_units_agree_with_pint():
    from cfem.core import units

    registry = units._registry()
    for system, table in units._USUAL.items():
        for unit, factor in table.items():
            assert registry.Quantity(1.0, unit).to(system).magnitude == pytest.approx(factor, rel=1e-14)


@pytest.mark.parametrize("text, unit", [("60 rpm", "Hz"), ("1 deg", "Hz"), ("1 percent", "rad"), ("1 pi", "rad")])
def test_turns_and_numbers_are_no_units(text, unit):
    with pytest.raises(ValueError, match="is not a unit"):
        parse_quantity(text, unit)


def test_a_quantity_is_the_same_with_and_without_a_blank_for_editors():
    from pydantic import TypeAdapter

    from cfem.core.units import Length

    pattern = re.compile(TypeAdapter(Length).json_schema()["pattern"])
    assert all(pattern.search(text) for text in ("9mm", "9 mm", "1e-2 m", "2 N/mm^2"))
    assert not any(pattern.search(text) for text in ("9", "mm", "9 mm+2 m", "2*3 mm", "(9) mm"))


def test_a_number_that_is_none_is_named():
    with pytest.raises(ValueError, match="expected finite numbers under 'N', got nan"):
        parse_array({"N": [0.0, float("nan"), 1.0]}, "N", 1, 3)


def test_a_plain_number_is_digits_with_a_point():
    assert [parse_number(text) for text in ("1", " -1.5e3 ", ".5", "+2.")] == [1.0, -1500.0, 0.5, 2.0]
    for text in ("1_0", "inf", "nan", "1e999", "0x1", "1,5", "", "١", "1 mm"):
        with pytest.raises(ValueError, match=r"is not a number|too large"):
            parse_number(text)
