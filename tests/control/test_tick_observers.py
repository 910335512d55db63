from dataclasses import replace

import numpy as np
import pytest
from support import arc_robot
from support.arc_robot import REACH, REST_E, ArcRobot, tip

from cfem.condensed.strokes import ridge_of
from cfem.control.closed_loop.run import Pace, run_closed_loop
from cfem.control.closed_loop.tick import Belief, Pilot, drive
from cfem.control.search.inverse import Limits
from cfem.core.errors import InputError, NumericalError
from cfem.plant.model_plant import ModelPlant
from cfem.plant.protocol import Measurement

RIDGE = ridge_of(1e-12, REACH, arc_robot.LENGTH)
PULLING = Limits.of(REACH, np.array([True, True]))
PILOT = Pilot(ArcRobot(), "force", "equilibrium", PULLING, np.ones(3), RIDGE)


def follow(observer, goals, iterations=1):
    """A swing through reachable points, forces into the very robot that the model is of."""
    pilot = replace(PILOT, observer=observer, settings=replace(PILOT.settings, iterations=iterations))
    start = np.array([4.0, 3.5])
    moments = run_closed_loop(goals, pilot, ModelPlant(ArcRobot(), REST_E), REST_E, Pace(0.5, 1, 1), start=start)
    return moments


def swing(ticks):
    return np.array([REST_E + tip(np.array([s, s - 0.5])) for s in np.linspace(4, 12, ticks)])


def astray(moments):
    """mm between where the observer takes the actuators to stand and where they do."""
    return np.array([np.abs(one.belief.iterate.condensed.delta_a - one.actual.delta_a).max() for one in moments])


def test_equilibrium_equals_the_measured_state():
    assert astray(follow("equilibrium", swing(12))).max() < 1e-10
    equilibrium, measured = (
        np.array([one.belief.u for one in follow(o, swing(12))]) for o in ("equilibrium", "measured")
    )
    np.testing.assert_allclose(equilibrium, measured, atol=1e-9)


def test_equilibrium_knows_where_a_command_leads_that_was_cut_down():
    pilot, start = replace(PILOT, rate=0.1), np.array([4.0, 3.5])
    moments = run_closed_loop(swing(2), pilot, ModelPlant(ArcRobot(), REST_E), REST_E, Pace(0.5, 1, 10), start=start)
    assert np.abs(np.diff([one.belief.u for one in moments], axis=0)).max() == pytest.approx(0.1)
    assert astray(moments).max() < 1e-9


def test_the_previous_step_is_off_by_the_square_of_the_step():
    off = {ticks: astray(follow("previous_step", swing(ticks)))[ticks // 2] for ticks in (9, 17, 33)}
    assert off[9] > 0.005
    assert 3 < off[9] / off[17] < 5 and 3 < off[17] / off[33] < 5


def test_the_previous_step_catches_up_where_the_goal_stays():
    there = np.repeat(swing(2)[1:], 8, axis=0)
    assert astray(follow("previous_step", there))[-1] < 1e-6


@pytest.mark.parametrize("sample, where", [([3.0, 2.5], [3.0, 2.5]), ([np.nan, 2.5], [2.0, 2.0])])
def test_the_measured_state_is_taken_where_there_is_a_sample(sample, where):
    pilot = replace(PILOT, observer="measured", settings=replace(PILOT.settings, iterations=0))
    measured = Measurement(REST_E, np.array(sample), None, 1, "converged")
    after = drive(pilot, Belief.at(pilot, np.array([2.0, 2.0])), np.zeros(3), measured)
    np.testing.assert_allclose(after.iterate.condensed.delta_a, where, atol=1e-12)


def test_a_sensor_that_is_missing_is_named():
    blind = Measurement(REST_E, None, None, 1, "converged")
    pilot = replace(PILOT, observer="measured")
    with pytest.raises(InputError, match="no sensor of delta_a"):
        drive(pilot, Belief.at(pilot, np.zeros(2)), np.zeros(3), blind)


def test_a_model_without_an_answer_leaves_the_command():
    class Broken(ArcRobot):
        def at_displacement(self, delta_a):
            if np.abs(delta_a).max() > 3:
                raise NumericalError("nothing here")
            return super().at_displacement(delta_a)

    pilot = replace(PILOT, model=Broken(), observer="previous_step")
    before = Belief.at(pilot, np.array([2.0, 2.0]))
    after = drive(pilot, before, tip(np.array([12.0, 12.0])))
    assert np.array_equal(after.u, before.u) and after.status == "nothing here"
