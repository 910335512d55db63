"""What a model states of its error."""

import pytest
from pydantic import ValidationError

from cfem.condensed.model_error import ErrorBound, model_error_of

BOUND = {"everywhere": 3.0, "factor": 0.5, "power": 2.0}
STATED = {"probability": 0.95, "states": 40, "left_out": 0, "command": "force"}
STATED |= dict.fromkeys(("tip", "actuators", "W"), BOUND)


def test_a_bound_grows_with_the_extrapolation():
    assert ErrorBound(**BOUND).at(4.0) == 8.0


def test_it_is_read_from_a_card_or_is_not_there():
    assert model_error_of(None) is None
    assert model_error_of(STATED).tip.everywhere == 3.0 and model_error_of(STATED).percent == "95 %"
    with pytest.raises(ValidationError):
        model_error_of({**STATED, "probability": 1.5})
