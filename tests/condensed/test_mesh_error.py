"""The error of a mesh at any state, from what is stated of it."""

import pytest
from pydantic import ValidationError

from cfem.condensed.mesh_error import ErrorShare, mesh_error_of

SHARE = ErrorShare(rest=(0.01, 0.02), far=(0.03, 0.06), largest=10.0)


def test_at_both_ends_the_shares_are_those_stated():
    assert SHARE.bounds(10.0) == pytest.approx((0.3, 0.6))
    assert SHARE.bounds(1e-3) == pytest.approx((1e-5, 2e-5), rel=1e-6)
    assert SHARE.highest == 0.06


def test_between_and_beyond_the_gain_goes_with_the_square():
    assert SHARE.bounds(5.0) == pytest.approx((5 * 0.015, 5 * 0.03))
    assert SHARE.bounds(20.0) == pytest.approx((20 * 0.09, 20 * 0.18))


def test_a_share_that_falls_does_not_fall_below_the_last_one():
    falling = ErrorShare(rest=(0.02, 0.04), far=(0.01, 0.01), largest=10.0)
    assert falling.bounds(100.0) == pytest.approx((1.0, 1.0)) and falling.highest == 0.04


def test_what_is_left_out_or_wrong_states_nothing():
    assert mesh_error_of(None) is None and mesh_error_of({"left_out": "no mesh"}) is None
    with pytest.raises(ValidationError):
        mesh_error_of({"tip": {"rest": [-1, 0], "far": [0, 0], "largest": 1}})
