"""Whatever bytes a device says: a measurement of bounded finite numbers, or one clear sentence."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cfem.condensed import Rows
from cfem.plant.device.answer import DEEPEST, Malformed, answer_of, nesting, numbers, shown
from cfem.plant.device.device_plant import DevicePlant
from cfem.plant.device.lines import Lines

REACH = np.array([[0.0, 30.0], [-5.0, 30.0]])
ROWS = Rows(("tip.x", "tip.y", "tip.rx"), ("left", "right"))
VALUES = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.just(10**400)),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(st.text(max_size=3), inner, max_size=3)),
    max_leaves=8,
)
NUMBERS = st.lists(st.one_of(st.floats(), st.floats(-100, 100), st.integers(-5, 5)), min_size=2, max_size=3)
OBJECTS = st.fixed_dictionaries(
    {},
    optional={
        "t": st.one_of(st.integers(-1, 4), VALUES),
        "x_e": st.one_of(NUMBERS, VALUES),
        "delta_a": st.one_of(NUMBERS, VALUES),
        "lambda_a": st.one_of(NUMBERS, VALUES),
        "markers": st.one_of(
            st.dictionaries(st.sampled_from(["top", "side", "?"]), st.one_of(NUMBERS, VALUES)), VALUES
        ),
    },
)


def judged(line, markers=()):
    """The measurement of a line, None where it is refused in a sentence."""
    plant = DevicePlant(Lines(["device"]), ROWS, np.zeros(3), markers=markers, length=50.0, reach=REACH)
    plant._t = 3
    try:
        found = plant._measured(answer_of(line))
    except Malformed as why:
        assert str(why) and len(str(why)) < 400 and str(why).isprintable()
        return None
    assert 0 <= found.t <= 3 and type(found.t) is int
    for name, size, far in (("x_e", 3, 500.0), ("delta_a", 2, 300.0), ("lambda_a", 2, np.inf)):
        read = getattr(found, name)
        assert read is None or (read.shape == (size,) and (np.isnan(read).all() or np.abs(read).max() <= far))
    return found


@settings(max_examples=300, deadline=None)
@given(data=st.binary(max_size=200))
def test_any_bytes_are_a_sentence(data):
    assert judged(data.decode("utf-8", "replace")) is None


@settings(max_examples=500, deadline=None)
@given(value=OBJECTS, markers=st.sampled_from([(), ("top", "side")]))
def test_any_object_is_a_measurement_or_a_sentence(value, markers):
    judged(json.dumps(value), markers)


@pytest.mark.slow
@settings(max_examples=20_000, deadline=None)
@given(value=OBJECTS, markers=st.sampled_from([(), ("top", "side")]))
def test_any_of_many_objects_is_a_measurement_or_a_sentence(value, markers):
    judged(json.dumps(value), markers)


@settings(max_examples=300, deadline=None)
@given(value=VALUES)
def test_nesting_is_that_of_the_parsed_value(value):
    def depth(one):
        inner = list(one.values()) if isinstance(one, dict) else one if isinstance(one, list) else None
        return 0 if inner is None else 1 + max(map(depth, inner), default=0)

    assert nesting(json.dumps(value)) == depth(value)
    assert nesting(json.dumps(value, ensure_ascii=False)) == depth(value)


def test_as_deep_as_allowed_is_parsed():
    deepest = '{"a": ' + "[" * (DEEPEST - 1) + "]" * (DEEPEST - 1) + "}"
    assert answer_of(deepest)
    with pytest.raises(Malformed, match="nested deeper than 8"):
        answer_of('{"a": ' + "[" * DEEPEST + "]" * DEEPEST + "}")


def test_a_good_answer_is_taken_as_it_is():
    found = judged('{"t": 3, "x_e": [499, -499, 0.5], "delta_a": [300, -299], "lambda_a": null}')
    assert found.t == 3 and found.lambda_a is None
    np.testing.assert_array_equal(found.x_e, [499, -499, 0.5])


def test_how_far_a_number_is_counts_from_rest():
    rest, farthest = np.array([100.0, -40.0]), np.array([50.0, 10.0])
    np.testing.assert_array_equal(numbers({"x_e": [149, -31]}, "x_e", rest, farthest), [149, -31])
    with pytest.raises(Malformed, match=r"number 2 is 11 from rest, at most 10"):
        numbers({"x_e": [149, -29]}, "x_e", rest, farthest)
    with pytest.raises(Malformed, match=r"number 1 is 51 from rest, at most 50"):
        numbers({"x_e": [49, -31]}, "x_e", rest, farthest)


def test_turns_have_a_range_of_their_own():
    assert judged('{"t": 3, "x_e": [0, 0, 62.8]}') and judged('{"t": 3, "x_e": [0, 0, 62.9]}') is None


def test_what_is_shown_is_one_short_line():
    assert shown("a\nb\x1b[2J") == r"a b\x1b[2J" and len(shown("x" * 1000)) < 90
