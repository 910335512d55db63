"""`discrepancy` of a scene."""

import numpy as np
import pytest

from cfem.condensed import Rows
from cfem.core.errors import SpecError
from cfem.robot.discrepancy import DiscrepancySpec, discrepancy_in

ROWS = Rows(("tip.x", "tip.y", "tip.z", "mass.x"), ("left", "chamber"))
UNITS = (("mm", "N"), ("mm^3", "MPa"))
LARGEST = {"left": "2 N", "chamber": "30 kPa"}


def made(**given):
    return discrepancy_in(DiscrepancySpec(**({"largest": LARGEST} | given)), ROWS, UNITS)


def test_terms_go_to_their_rows_in_the_units_of_the_actuators():
    terms = [
        {"forces": ["chamber"], "effectors": {"tip": {"mm": [1, 0, 2]}}},
        {"forces": ["chamber", "left"], "effectors": {"tip": {"mm": [0, 0, 4]}}},
    ]
    lacking = made(terms=terms)
    assert lacking.rows == ("tip.x", "tip.z")
    np.testing.assert_allclose(lacking.value(np.array([1.0, 0.03])), [1, 2 + 4 / 2])


def test_without_terms_there_is_none():
    assert made() is None and discrepancy_in(None, ROWS, UNITS) is None


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"largest": {"left": "2 N"}}, "lacks actuator 'chamber'"),
        ({"largest": LARGEST | {"right": "2 N"}}, "no actuator 'right'"),
        ({"largest": LARGEST | {"left": "2 kPa"}}, "is not a unit of force"),
        ({"largest": LARGEST | {"left": "0 N"}}, "must be above 0"),
        ({"terms": [{"forces": ["up"], "effectors": {"tip": {"mm": [0, 0, 1]}}}]}, "no actuator 'up'"),
        ({"terms": [{"forces": ["left"], "effectors": {"toe": {"mm": [0, 0, 1]}}}]}, "no effector 'toe'"),
        ({"terms": [{"forces": ["left"], "effectors": {"mass": {"mm": [0, 0, 1]}}}]}, "no rows x, y and z"),
    ],
)
def test_what_cannot_be_is_one_sentence(given, message):
    with pytest.raises(SpecError, match=message):
        made(**given)
