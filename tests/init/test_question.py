"""Answers are read as a person writes them, and refused in one sentence that names the option."""

import numpy as np
import pytest

from cfem.core.errors import SpecError
from cfem.init.further import gravity
from cfem.init.question import Question, answer, integer, named, point, positive


@pytest.mark.parametrize("text", ["1, -2, 3e1", "1,-2,30 mm", " 0.1, -0.2, 3 cm ", "1e-3,-2e-3,0.03m"])
def test_points_in_any_unit(text):
    np.testing.assert_allclose(point(text), [1, -2, 30], rtol=1e-12)


@pytest.mark.parametrize("text", ["", "1, 2", "1, 2, 3, 4", "1, 2, x", "1, 2, nan", "1, 2, 3 kPa"])
def test_what_is_no_point(text):
    with pytest.raises(ValueError, match=r"expected three coordinates|not a unit of length"):
        point(text)


@pytest.mark.parametrize("text", ["0", "13", "-1", "2.5", "two", ""])
def test_what_is_no_count(text):
    with pytest.raises(ValueError, match="whole number from 1 to 12"):
        integer(text, 1, 12)


@pytest.mark.parametrize("text", ["9.81", "0, 0, 9.81 mm", "down"])
def test_what_is_no_gravity_is_told_the_unit_of_gravity(text):
    with pytest.raises(ValueError, match=r"in m/s\^2, got"):
        gravity(text)


def test_a_default_is_a_guess_and_an_answer_is_not():
    question = Question("young", "Young's modulus?", "500 kPa", "a rubber", lambda text: positive(text, "MPa"))
    assert (answer(question, None).value, answer(question, None).guess) == (0.5, "a rubber")
    assert (answer(question, "500 kPa").value, answer(question, "500 kPa").guess) == (0.5, None)
    with pytest.raises(SpecError, match=r"--young: must be above zero, got '-1 kPa' \(write it as in '500 kPa'\)"):
        answer(question, "-1 kPa")
    nothing = Question("region", "Where?", "none", "none", lambda text: positive(text, "mm"))
    with pytest.raises(SpecError, match=r"--region: must be above zero, got '-1 mm'$"):
        answer(nothing, "-1 mm")


def test_a_name_is_one_that_a_scene_takes():
    assert named(" left-1: 1, 2, 3", "'NAME: x, y, z'") == ("left-1", " 1, 2, 3")
    for text, said in (
        ("left", "expected 'NAME"),
        (": 1, 2, 3", "expected 'NAME"),
        ("zug 1: 1, 2, 3", "a name has letters"),
    ):
        with pytest.raises(ValueError, match=said):
            named(text, "'NAME: x, y, z'")
    with pytest.raises(ValueError, match="got 'größe'"):
        named("größe: 1, 2, 3", "'NAME: x, y, z'")
