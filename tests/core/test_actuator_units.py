"""10 MPa must never become a limit of 10 N: quantities of actuators keep the unit that they were written in."""

import copy
import json
import pickle

import jsonschema
import pytest
from pydantic import Field

from cfem.core.actuator_units import CABLE, CHAMBER, Displacement, Displacements, Effort, demand_units
from cfem.core.errors import SpecError
from cfem.core.spec import Spec, json_schema, meaning


class Part(Spec):
    step: Displacement = 5.0
    largest: Effort | None = Field(None, gt=0)


class Whole(Spec):
    part: Part = Part()
    many: dict[str, Part] = {}
    start: Displacements | None = None


RIGHT = [
    ({"part": {"step": "2 mm", "largest": "3 N"}, "start": {"cm": [1, 2]}}, CABLE),
    ({"part": {"step": "2 ml", "largest": "3 kPa"}, "start": {"mm^3": [1, 2]}}, CHAMBER),
    ({}, CABLE),
    ({}, CHAMBER),
]
WRONG = [
    ({"part": {"largest": "10 MPa"}}, CABLE, r"part\.largest: is a stress \(MPa\), but the force .* a force \(N\)"),
    ({"part": {"step": "1 l"}}, CABLE, r"part\.step: is a volume .*give it in mm\)"),
    ({"many": {"a": {"largest": "10 N"}}}, CHAMBER, r"many\.a\.largest: is a force"),
    ({"start": {"mm": [1, 2]}}, CHAMBER, r"start\.0: is a length"),
]


@pytest.mark.parametrize("data, units", RIGHT)
def test_quantities_of_the_robots_actuators_pass(data, units):
    demand_units(Whole.model_validate(data), [units, units])


@pytest.mark.parametrize("data, units, why", WRONG)
def test_quantities_of_other_actuators_are_refused_by_name(data, units, why):
    with pytest.raises(SpecError, match=why):
        demand_units(Whole.model_validate(data), [units, units])


def test_one_number_cannot_bound_cables_and_chambers_at_once():
    with pytest.raises(SpecError, match=r"part\.largest.*leave it out"):
        demand_units(Whole.model_validate({"part": {"largest": "10 N"}}), [CABLE, CHAMBER])


def test_they_are_numbers_in_the_system_of_units():
    whole = Whole.model_validate({"part": {"step": "2 cm", "largest": "3 kPa"}, "start": {"ml": [1, 2]}})
    assert whole.part.step == 20.0 and whole.part.largest == pytest.approx(3e-3) and whole.start == (1000.0, 2000.0)
    assert json.dumps(meaning(whole)["part"]["step"]) == "20.0"
    for same in (copy.deepcopy(whole), pickle.loads(pickle.dumps(whole))):
        with pytest.raises(SpecError):
            demand_units(same, [CABLE])
    with pytest.raises(ValueError, match="greater than 0"):
        Part(largest="-1 N")
    with pytest.raises(ValueError, match=r"not a unit of force.*or MPa"):
        Part(largest="1 mm")


def test_editors_know_them():
    schema = json_schema(Whole)
    jsonschema.Draft7Validator(schema).validate({"part": {"step": "2mm"}, "start": {"mm": [1.0]}})
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.Draft7Validator(schema).validate({"part": {"step": 2}})
