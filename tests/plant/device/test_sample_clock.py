"""Times of samples by our clock, and the commands that they followed."""

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.plant.device.sample_clock import WINDOW, CommandTimes, SampleClock


def test_without_a_stamp_it_is_the_arrival_less_the_latency():
    assert SampleClock(latency=0.02).taken(None, 10.0) == pytest.approx(9.98)


def test_a_stamp_of_our_clock_is_the_time_and_never_in_the_future():
    clock = SampleClock(tolerance=0.1, latency=0.02)
    assert clock.taken(9.5, 10.0) == 9.5 and clock.taken(10.05, 10.0) == 10.0
    with pytest.raises(InputError, match=r"lies 0\.20 s in the future"):
        clock.taken(10.2, 10.0)


@pytest.mark.parametrize("offset", [-1e6, -40.0, 0.0, 40.0, 1e6])
def test_the_offset_of_another_clock_is_found_from_the_quickest_sample(offset):
    """A clock that runs 50 ppm fast, samples that travel for 5 ms and up to 40 more: times are right to 1 ms and the
    drift in the window."""
    random, clock = np.random.default_rng(1), SampleClock(latency=0.005, foreign=True)
    off = []
    for taken in np.arange(0.0, 60.0, 0.02):
        found = clock.taken(taken * (1 + 5e-5) + offset, taken + 0.005 + random.exponential(0.01))
        off.append(abs(found - taken))
    assert max(off[WINDOW:]) < 1.5e-3


def test_another_clock_that_jumps_ahead_costs_one_sample():
    clock = SampleClock(foreign=True)
    assert clock.taken(100.0, 10.0) == pytest.approx(10.0)
    with pytest.raises(InputError, match=r"lies 40\.00 s in the future: the other clock has jumped"):
        clock.taken(140.02, 10.02)
    assert clock.taken(140.04, 10.04) == pytest.approx(10.04)


def test_another_clock_that_is_put_back_is_old_until_the_window_has_passed():
    clock = SampleClock(foreign=True)
    clock.taken(100.0, 10.0)
    found = [clock.taken(60.0 + 0.02 * k, 10.0 + 0.02 * k) - (10.0 + 0.02 * k) for k in range(1, WINDOW + 1)]
    assert found[:-1] == pytest.approx([-40.0] * (WINDOW - 1)) and found[-1] == pytest.approx(0.0)


def test_a_sample_followed_the_last_command_before_it():
    commands = CommandTimes(history=3)
    assert commands.followed(5.0) == 0
    for now in (1.0, 2.0, 3.0, 4.0):
        commands.given(now)
    assert [commands.followed(time) for time in (0.5, 1.5, 2.0, 2.5, 4.0, 9.0)] == [0, 0, 0, 2, 3, 4]


@pytest.mark.parametrize("back", [0.5, 1.5])
def test_commands_before_the_clock_was_put_back_are_forgotten(back):
    commands = CommandTimes()
    for now in (1.0, 2.0, back):
        commands.given(now)
    assert commands.followed(back - 0.1) == 0 and commands.followed(back + 0.1) == 3
    commands.given(back)  # no later: the clock stands
    assert commands.followed(back + 0.1) == 4 and commands.followed(back) == 0
