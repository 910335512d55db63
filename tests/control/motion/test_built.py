"""Controllers that know how the robot moves, built from their spec."""

from types import SimpleNamespace

import numpy as np
import pytest
from control.motion.bar import DT, LENGTH, REACH, pilot, robot, standing, swing

from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.pilots import Situation
from cfem.control.closed_loop.spec import ControllerSpec
from cfem.control.motion.built import _planes, controller_of, doubt_of
from cfem.control.motion.feedforward import Computed, Shaped
from cfem.control.motion.mpc import Mpc
from cfem.core.errors import SpecError
from cfem.motion.mpc_spec import DoubtSpec, HalfSpaceSpec, MpcSpec


def situation(start=None, noise=0.0):
    loop = SimpleNamespace(rate=1 / DT, estimate=None, sensor=SimpleNamespace(noise=noise))
    return Situation(loop, robot().rest_e, REACH, LENGTH, np.full(3, 1e3), start)


def built(spec, kind="force", start=None, **more):
    return controller_of(ControllerSpec.model_validate(spec), pilot(kind), None, robot(), situation(start, **more))


@pytest.mark.parametrize("start", [None, 2.4])
def test_a_computed_controller_begins_where_the_robot_stands(start):
    state = None if start is None else standing(start)
    made = built({"mode": "open", "feedforward": True}, start=state)
    assert isinstance(made, Computed)
    where = np.zeros(1) if start is None else state.delta_a
    by_hand = Computed(pilot(), robot(), robot().rest_e, where, DT)
    for goal in swing(16.6, 3):
        np.testing.assert_array_equal(made.tick(goal).u, by_hand.tick(goal).u)


@pytest.mark.parametrize("kind", ["force", "displacement"])
def test_a_shaped_controller_shapes_the_modes_of_what_is_commanded(kind):
    """Modes of held actuators where displacements are commanded."""
    start = standing(2.4 if kind == "force" else 1.5, kind)
    made = built({"mode": "open", "shaping": {"kind": "zvd", "modes": 1}}, kind, start)
    by_hand = Shaped(
        Controller(pilot(kind), robot().rest_e, None, start.delta_a), robot(), kind == "displacement", "zvd", 1, DT
    )
    for goal in swing(16.6, 4, kind):
        np.testing.assert_array_equal(made.tick(goal).u, by_hand.tick(goal).u)
    np.testing.assert_array_equal(made.shaper.time, by_hand.shaper.time)


def test_without_any_of_these_it_is_the_static_controller():
    assert type(built({"mode": "open"})) is Controller


@pytest.mark.parametrize(("kind", "full"), [("force", None), ("displacement", REACH[0, 1])])
def test_a_predictive_controller_has_costs_by_length_and_full_command(kind, full):
    """From rest, where nobody says where the robot stands; a change by the full range costs `smooth` times a miss by
    the length."""
    made = built({"mode": "open", "mpc": {"smooth": 0.04, "effort": 0.09, "horizon": 7}}, kind)
    assert isinstance(made, Mpc) and made.observer is None
    np.testing.assert_allclose(made.aimed, robot().rest_e + robot().static.at_displacement([0.0]).delta_e)
    plan, full = made._plan, full or np.abs(robot().static.domain.lambda_a).max()
    assert plan.ticks == 7
    np.testing.assert_allclose(plan.cost.smooth, 0.2 * LENGTH / full)
    np.testing.assert_allclose(plan.cost.effort, 0.3 * LENGTH / full)
    limits = pilot(kind).limits
    command, course = (limits.lambda_a, limits.delta_a) if kind == "force" else (limits.delta_a, limits.lambda_a)
    np.testing.assert_array_equal(plan.bounds.command, command)
    np.testing.assert_array_equal(plan.bounds.course, course)


@pytest.mark.parametrize(
    ("stated", "sensor", "noise"), [(None, 0.0, 0.01), (None, 0.2, 0.2), (0.5, 0.2, 0.5), (0.5, 0.0, 0.5)]
)
def test_the_noise_that_an_observer_knows_is_that_stated_or_of_the_sensor(stated, sensor, noise):
    known = {"noise": None if stated is None else f"{stated} mm", "offset": "0.7 mm", "push": "0.8 mm"}
    doubt = DoubtSpec(**known, stiffness=0.4, viscosity=0.5, wander=0.6)
    found = doubt_of(MpcSpec(doubt=doubt), sensor)
    assert (found.noise, found.stiffness, found.viscosity) == (noise, 0.4, 0.5)
    assert (found.wander, found.offset, found.push) == (0.6, 0.7, 0.8)


def test_a_closed_loop_observes_with_the_noise_of_its_sensor():
    made = built({"mode": "closed", "mpc": {}}, noise=0.03)
    assert made.observer is not None and made.observer._doubt.noise == 0.03


def test_planes_are_half_spaces_of_the_first_effector():
    spec = MpcSpec(obstacles=[HalfSpaceSpec(point={"mm": [1, 2, 3]}, normal=[0, 3, 4])])
    (plane,) = _planes(spec, 6)
    np.testing.assert_allclose(plane.normal, [0, 0.6, 0.8, 0, 0, 0])
    assert plane.level == pytest.approx(0.6 * 2 + 0.8 * 3)
    with pytest.raises(SpecError, match="rows x, y, z"):
        _planes(spec, 2)
    (plain,) = _planes(spec, 3)
    assert len(plain.normal) == 3 and _planes(MpcSpec(), 2) == ()
