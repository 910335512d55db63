"""Whatever messages come, in whatever order: a command within bounds and a sentence, or a refusal."""

import importlib
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ros2 import ros
from surrogate.stored import train_folder

import cfem

PACKAGE = Path(__file__).parents[2] / "ros2" / "cfem_ros"
MESSAGES = ros.written()
NUMBERS = st.one_of(st.floats(), st.floats(-0.2, 0.2), st.sampled_from([0.0, 1e308, -1e308, 5e-324]))
STAMPS = st.one_of(
    st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)),
    st.tuples(st.integers(995, 1005), st.integers(0, 10**9 - 1)),
    st.just((0, 0)),
)
FRAMES = st.one_of(st.just("robot"), st.text(max_size=8))
POINTS = st.tuples(st.sampled_from(["goal", "effector"]), STAMPS, FRAMES, st.tuples(NUMBERS, NUMBERS, NUMBERS))
TICKS = st.tuples(st.just("tick"), st.one_of(st.floats(0.0, 0.1), st.floats(-100.0, 100.0)))


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    return cfem.load_model(train_folder(tmp_path_factory.mktemp("bridge"), "{kind: spectral, max_degree: 6}", train=40))


@pytest.fixture(scope="module")
def package():
    patch = pytest.MonkeyPatch()
    patch.syspath_prepend(str(PACKAGE))
    ros.install(patch, MESSAGES)
    yield importlib.import_module("cfem_ros.bridge")
    patch.undo()


def made(package, model, **given):
    types = package.Types(**{name.split("/")[-1]: kind for name, kind in MESSAGES.items()})
    return package.Bridge(model, types, None, package.Settings(**given))


def message(stamp, frame, place):
    time = MESSAGES["builtin_interfaces/msg/Time"](*stamp)
    header = MESSAGES["std_msgs/msg/Header"](time, frame)
    return MESSAGES["geometry_msgs/msg/PointStamped"](header, MESSAGES["geometry_msgs/msg/Point"](*place))


def played(package, bridge, model, events):
    """Each tick has a finite command within bounds, and says how it is."""
    now, low, high = 1000.0, *model.reach.T
    for name, *event in events:
        if name == "tick":
            now += event[0]
            told = bridge.tick(now)
            u = np.array(told.command.position) * 1e3
            assert np.isfinite(u).all() and (u >= low - 1e-9).all() and (u <= high + 1e-9).all()
            (status,) = told.diagnostics.status
            assert status.level in (b"\0", b"\1", b"\2", b"\3") and status.message
            assert told.array.data == told.command.position
        else:
            try:
                {"goal": bridge.on_goal, "effector": bridge.on_effector}[name](message(*event), now)
            except package.Refused as why:
                assert str(why)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(events=st.lists(st.one_of(POINTS, TICKS, TICKS), max_size=12), other=st.booleans())
def test_no_message_ends_in_more_than_a_refusal(package, model, events, other):
    played(package, made(package, model, effector_clock="other" if other else "own"), model, events)


@pytest.mark.slow
@settings(max_examples=2000, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(events=st.lists(st.one_of(POINTS, TICKS, TICKS), max_size=40), other=st.booleans())
def test_no_message_ends_in_more_than_a_refusal_in_long(package, model, events, other):
    played(package, made(package, model, effector_clock="other" if other else "own"), model, events)


def test_what_was_refused_is_said_at_the_next_tick(package, model):
    bridge = made(package, model)
    with pytest.raises(package.Refused, match="not finite"):
        bridge.on_effector(message((1000, 0), "robot", (math.nan, 0.0, 0.0)), 1000.0)
    (status,) = bridge.tick(1000.0).diagnostics.status
    assert status.level == b"\2" and "not finite" in status.message
