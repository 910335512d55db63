"""A parameter's card holds values that its coordinate can take."""

import pytest
from pydantic import ValidationError

from cfem.condensed.card import ParameterCard

CARD = dict(name="nu", key="material.poisson", unit="1", low=0.3, high=0.49, reference=0.45, coordinate="log(1-2p)")


def test_values_within_their_coordinate_are_taken():
    assert ParameterCard(**CARD, exact=False).high == 0.49
    assert ParameterCard(**{**CARD, "coordinate": "linear", "low": -1.0}, exact=False).low == -1.0


@pytest.mark.parametrize(
    "change",
    [{"high": 0.5}, {"reference": 0.6}, {"low": 0.49}, {"coordinate": "log", "low": 0.0}, {"exact": True, "low": -1.0}],
)
def test_values_that_it_cannot_take_are_refused(change):
    with pytest.raises(ValidationError):
        ParameterCard(**{**CARD, "exact": False, **change})
