"""What a run states of the error of its models' contact: at how many goals it held."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.condensed import Rows
from cfem.condensed.model_error import ContactError, ContactFactors
from cfem.control.task.obstacles.stated import stated_errors

FACTORS = ContactFactors(probability=0.95, places=20, force=0.02, tip=0.01)
REST = np.array([10.0, 0.0, 0.0, 0.0])


def model(stated):
    rows = Rows(("tip.x", "tip.y", "tip.z", "ball.force"), ("cable",))
    return SimpleNamespace(
        rows=rows,
        stated=() if stated is None else (stated,),
        patched=SimpleNamespace(model=SimpleNamespace(rest_e=REST[:3])),
    )


def goal(tip_off, force_off, **more):
    predicted = np.array([1.0, 0.0, 0.0, 0.2])
    x_e = REST + predicted + [0.0, tip_off, 0.0, force_off]
    row = {"controller": "m", "plant_status": "converged", "predicted_e": predicted, "x_e": x_e}
    return row | {"force_error": 0.01, "model_error": 0.05} | more


@pytest.fixture(scope="module")
def stated():
    given = {"probability": 0.95, "left_out": 3, "most": 3, "points": 5, "off": [0.1], "friction": 0.3}
    return ContactError(**given, one=FACTORS, several=None)


def test_goals_within_both_bounds_are_counted(stated):
    rows = [goal(0.04, -0.009), goal(0.06, 0.0), goal(0.0, 0.02), goal(0.0, 0.0, force_error=np.inf)]
    rows += [goal(0.0, 0.0, controller="m@1"), goal(0.0, 0.0, plant_status="failed")]
    figures, (line,) = stated_errors({"m": model(stated)}, 23, rows, REST)
    assert {key: figures["m"][key] for key in ("goals", "stated", "within")} == {"goals": 4, "stated": 3, "within": 1}
    assert "force of each obstacle within 0.01 N, tip within 50 µm" in line and "it held at 1 of 3 goals" in line
    assert "with 95 % (from 20 random places of one rigid obstacle and 0 of several, friction 0.3)" in line
    assert "NOT stated at 1" in line


def test_a_model_of_which_nothing_is_known_says_so(stated):
    figures, (line,) = stated_errors({"m": model(None)}, 23, [], REST)
    assert figures == {"m": None} and "no error stated" in line
    assert stated_errors({"m": model(None)}, 0, [], REST) == ({}, [])
    figures, (line,) = stated_errors({"m": model(stated)}, 23, [goal(0.0, 0.0, model_error=np.inf)], REST)
    assert "not trusted" in line and figures["m"]["largest"]["force_error"] is None
