"""Commands over time: steps that are not found are taken in halves."""

import numpy as np
import pytest
from motion.learned import model

from cfem.core.errors import NumericalError
from cfem.motion import simulate as simulated
from cfem.motion.simulate import simulate
from cfem.motion.step import MotionCommand, at_rest

DT, STEPS = 2e-3, 3


def pulled(t: float) -> MotionCommand:
    """A force that rises."""
    return MotionCommand(force=np.array([0.5 + 20.0 * t]))


def motion(dt: float, **more):
    start = at_rest(model(), [1.0])
    return simulate(model(), start, pulled, STEPS * DT, dt, **more)


@pytest.fixture
def no_longer_than(monkeypatch):
    """Steps beyond a length fail from here on; the lengths that are tried."""

    def fail_beyond(longest: float) -> list[float]:
        step, tried = simulated.step, []

        def some(moving, now, command, dt, payload):
            tried.append(dt)
            if dt > longest:
                raise NumericalError("too long")
            return step(moving, now, command, dt, payload)

        monkeypatch.setattr(simulated, "step", some)
        return tried

    return fail_beyond


def test_steps_in_halves_are_shorter_steps_with_the_commands_of_their_times(no_longer_than):
    short = motion(DT / 4)
    no_longer_than(0.3 * DT)
    halved = motion(DT)
    np.testing.assert_allclose(halved.t, DT * np.arange(STEPS + 1))
    for name in ("delta_a", "delta_e", "lam"):
        np.testing.assert_allclose(getattr(halved, name), getattr(short, name)[::4], rtol=1e-9, atol=1e-12)


def test_a_motion_says_which_steps_were_halved_and_why(no_longer_than):
    tried = no_longer_than(0.3 * DT)
    halved = motion(DT).shortened
    starts, lengths = [0.0, 0.0, 0.5], [1.0, 0.5, 0.5]  # of a step: whole, then each half
    np.testing.assert_allclose([t for t, _, _ in halved], DT * np.add.outer(np.arange(STEPS), starts).ravel())
    np.testing.assert_allclose([length for _, length, _ in halved], DT * np.tile(lengths, STEPS))
    assert {why for _, _, why in halved} == {"too long"}
    assert len(tried) == 7 * STEPS


def test_a_step_that_no_halves_help_is_an_error_after_eight_of_them(no_longer_than):
    tried = no_longer_than(0.0)
    with pytest.raises(NumericalError, match="too long"):
        motion(DT)
    np.testing.assert_allclose(tried, DT * 0.5 ** np.arange(9))


def test_a_second_half_is_halved_as_often_as_a_first(monkeypatch):
    step, tried = simulated.step, []

    def some(moving, now, command, dt, payload):
        tried.append(dt)
        if dt > DT / 2 or now.t >= DT / 2:
            raise NumericalError("too long, or too late")
        return step(moving, now, command, dt, payload)

    monkeypatch.setattr(simulated, "step", some)
    with pytest.raises(NumericalError, match="too late"):
        motion(DT)
    np.testing.assert_allclose(tried, DT * np.concatenate([[1.0], [0.5], 0.5 ** np.arange(1, 9)]))


def test_a_motion_ends_at_its_time_whatever_the_step(no_longer_than):
    tried = no_longer_than(1.0)
    ends = motion(0.8 * DT)  # of 3.75 steps 4 are made
    assert ends.t[-1] == pytest.approx(STEPS * DT) and ends.end.t == ends.t[-1]
    np.testing.assert_allclose(tried, STEPS * DT / 4)
