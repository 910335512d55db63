"""Standard deviations that a filter on the dynamics takes from a spec, and those that it assumes."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.motion.estimation.uncertainty import MotionUncertainty, motion_uncertainty
from cfem.predict.estimation.spec import MarkersSpec

MODEL = SimpleNamespace(length=120.0, reach=np.array([[0.0, 8.0], [-2.0, 10.0]]))
MARKERS = {"markers": {"tip": {"mm": [0, 0, 0]}}, "noise": "0.1 mm"}


def uncertainty(rate=25.0, lasts=None, **more):
    return motion_uncertainty(MarkersSpec.model_validate({**MARKERS, **more}), MODEL, rate, lasts)


def test_without_a_word_the_robot_swings_by_a_twentieth_of_its_length_at_the_start():
    assumed = uncertainty()
    assert assumed.swing == pytest.approx(6.0)
    assert (assumed.push, assumed.stiffness, assumed.wander) == (0.03, 0.1, 0.1)
    assert assumed.lasts == np.inf
    assert uncertainty(dynamics={"push": "0.1 mm"}).swing == pytest.approx(6.0)


def test_what_the_spec_states_is_taken():
    stated = uncertainty(
        dynamics={"swing": "2 mm", "push": "0.5 mm", "stiffness": 0.3, "wander": 0.2},
        actuators={"slip": "0.02 mm", "offset": "0.3 mm"},
    )
    assert (stated.swing, stated.push, stated.stiffness, stated.wander) == (2.0, 0.5, 0.3, 0.2)
    assert (stated.slip, stated.offset) == pytest.approx((0.02 * 5, 0.3))  # 25 frames a second


def test_slip_of_a_second_does_not_depend_on_the_frames():
    assert uncertainty(rate=100.0).slip == pytest.approx(2 * uncertainty(rate=25.0).slip)


def test_a_load_lasts_as_long_as_spec_or_caller_say():
    loads = {"rows": ["tip.x"], "largest": "1 N", "lasts": "0.5 s"}
    assert uncertainty(loads=loads).lasts == 0.5
    assert uncertainty(loads=loads, lasts=0.25).lasts == 0.25


@pytest.mark.parametrize("name", ["slip", "offset", "swing", "push", "lasts"])
def test_a_deviation_that_is_not_positive_is_refused(name):
    with pytest.raises(InputError, match="must be positive"):
        MotionUncertainty(**{"slip": 1.0, "offset": 1.0, "swing": 1.0, name: 0.0})
