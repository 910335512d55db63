"""The filter of a loop, from what its spec states or leaves out."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.control.closed_loop import estimated
from cfem.control.closed_loop.estimated import camera_of, loop_filter
from cfem.predict.estimation import filter as filter_module
from cfem.predict.estimation.gate import GateSpec
from cfem.predict.estimation.spec import ActuatorSensorsSpec, LoadsSpec

MODEL = SimpleNamespace(reach=np.array([[-2.0, 8.0], [0.0, 5.0]]), length=60.0)


def loop(loads=None, rate=50.0, ticks_a_sample=2, **actuators):
    sensors = ActuatorSensorsSpec(**actuators)
    lasts = np.inf if loads is None or loads.lasts is None else loads.lasts
    estimate = SimpleNamespace(loads=loads, lasts=lasts, actuators=sensors, gate=GateSpec(), dynamics=None, noise=0.1)
    command = SimpleNamespace(kind="displacement")
    return SimpleNamespace(estimate=estimate, rate=rate, ticks_a_sample=ticks_a_sample, command=command)


def lasting(seconds):
    return LoadsSpec(rows=["tip.x"], largest="10 mN", lasts=seconds)


@pytest.fixture(autouse=True)
def no_estimator(monkeypatch):
    for module in (estimated, filter_module):
        monkeypatch.setattr(module, "estimator_of", lambda spec, model, p=None: "estimator")
    monkeypatch.setattr(estimated, "MarkerFilter", lambda *given: given)


def test_slip_and_offset_are_shares_of_the_largest_reach():
    found = loop_filter(loop(), MODEL, None)
    assert (found.slip, found.offset) == (pytest.approx(5e-4 * 8.0), pytest.approx(0.05 * 8.0))
    stated = loop_filter(loop(slip="0.02 mm", offset="0.7 mm"), MODEL, None)
    assert (stated.slip, stated.offset) == (pytest.approx(0.02), pytest.approx(0.7))


@pytest.mark.parametrize(
    ("loads", "ticks"), [(None, 1e9), (lasting(None), 1e9), (lasting("2 s"), 50.0), (lasting("1 ms"), 0.1)]
)
def test_a_load_lasts_so_many_samples(loads, ticks):
    """Of 50 Hz, every second of which is a sample; a tenth at least."""
    assert loop_filter(loop(loads), MODEL, None).ticks == pytest.approx(ticks)


@pytest.mark.parametrize(("loads", "lasts"), [(None, np.inf), (lasting("2 s"), 2.0)])
def test_on_the_dynamics_a_slip_is_that_of_a_second(loads, lasts):
    """As many samples in a second add their variances."""
    estimator, motion, kind, uncertainty, _ = loop_filter(loop(loads, slip="0.02 mm"), MODEL, "motion")
    assert (estimator, motion, kind) == ("estimator", "motion", "displacement")
    assert uncertainty.slip == pytest.approx(0.02 * np.sqrt(25))
    assert uncertainty.offset == pytest.approx(0.4) and uncertainty.lasts == lasts
    assert uncertainty.swing == pytest.approx(0.05 * 60.0)


def test_a_camera_is_that_of_the_spec():
    assert camera_of(None, 3) is None
