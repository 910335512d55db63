"""The unit of a file without one: guessed where bodies of soft robots have that size, and doubted where others fit."""

from types import SimpleNamespace

import numpy as np
import pytest
from init.bodies import write_stl

from cfem.init.body.shape import read_source
from cfem.init.question import answer
from cfem.init.unit import natural_unit, unit_doubt, unit_of


def source(length: float):
    return SimpleNamespace(extent=np.array([length, length / 4, length / 4]), volume=length**3 / 16)


@pytest.mark.parametrize(
    ("length", "unit"), [(0.02, "m"), (0.12, "m"), (0.6, "m"), (60, "mm"), (195, "mm"), (900, "mm")]
)
def test_sizes_of_soft_robots_in_usual_units_are_taken_without_a_doubt(length, unit):
    assert (natural_unit(source(length)), unit_doubt(source(length))) == (unit, "")


@pytest.mark.parametrize(
    ("length", "unit", "doubt"),
    [
        (3.15, "inch", "in mm it would be 3.15 mm long and in cm it would be 31.5 mm long"),
        (12, "mm", "in inch it would be 305 mm long and in cm it would be 120 mm long"),
        (0.9, "m", "in mm it would be 0.9 mm long and in inch it would be 22.9 mm long"),
        (0.005, "m", "soft robots measure 10 to 1000 mm, and the body does in no usual unit"),
        (1500, "mm", "soft robots measure 10 to 1000 mm, and the body does in no usual unit"),
    ],
)
def test_a_size_that_fits_other_units_or_none_is_doubted(length, unit, doubt):
    assert (natural_unit(source(length)), unit_doubt(source(length))) == (unit, doubt)


@pytest.mark.parametrize(("length", "unit"), [(0.06, "m"), (3.15, "inch"), (60.0, "mm")])
def test_a_cad_file_is_guessed_by_its_volume(length, unit):
    body = SimpleNamespace(extent=None, volume=length**3 / 25)
    assert natural_unit(body) == unit and bool(unit_doubt(body)) == (unit == "inch")


def test_the_question_has_the_doubt_and_takes_the_guess(tmp_path):
    write_stl(tmp_path / "finger.stl", (3.15, 0.8, 0.8))
    asked = []

    def ask(question):
        asked.append(question)
        return answer(question, None)

    assert unit_of(read_source(tmp_path / "finger.stl"), ask).value == 25.4
    assert asked[0].default == "1 inch"
    assert asked[0].why.startswith("the body then measures 3.15 x 0.8 x 0.8 inch; UNCERTAIN: in mm it would be 3.15 mm")
