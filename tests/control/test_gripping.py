"""Plans for two bars that squeeze a block between their ends, on a table: the same equations as finite elements."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed import Rows
from cfem.condensed.coupling import Coupled, Hold, RigidObject, state_of
from cfem.constraint.contact import make_contact
from cfem.contact.obstacle import Box
from cfem.control.assembled import table_under
from cfem.control.controller import Controller
from cfem.control.grasp import from_table, share_that_lifts, taken
from cfem.control.gripping import Grip, Gripping
from cfem.control.inverse import Limits
from cfem.control.loop import Settings
from cfem.control.tick import Pilot
from cfem.core.errors import SpecError
from cfem.equilibrium.grip import Free
from cfem.equilibrium.held_patch import contact_points, patch_of
from cfem.equilibrium.patch_compliance import within_patch
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.touch import PlacedRobot
from cfem.plant.fem_patch import FemPatch
from cfem.plant.grip_plant import GripPlant
from cfem.predict.finger import LearnedFinger, WithinPatch

CENTRE, HALF, WEIGHT, MU = np.array([65.0, 5.0, 5.0]), np.array([5.0, 5.0, 5.0]), 2e-2, 0.8
FLIP = np.diag([-1.0, -1.0, 1.0])
PLACES = [(np.eye(3), np.zeros(3)), (FLIP, CENTRE - FLIP @ CENTRE)]
GRASP = np.full(4, -0.004)  # cables that push stretch the bars
ENDS = np.array([0, 2, 4])


class Linear:
    """A bar by its stiffness at rest, of its cables and its patch."""

    def __init__(self, stiffness):
        self.rows, self.stiffness = Rows((), ("cable-0", "cable-1", *"xyzuvw"), ()), stiffness

    def slopes(self, delta):
        return np.atleast_2d(delta) @ self.stiffness, self.stiffness[None]


@pytest.fixture(scope="module")
def robot():
    """A bar with three points on its end, whose cables push as well as they pull."""
    plain = bar(element="hex8", contact=True, divisions=(4, 2, 2))
    places = [(60.0, 3.0, 3.0), (60.0, 7.0, 3.0), (60.0, 5.0, 8.0)]
    contacts = tuple(make_contact(plain.body.mesh, np.array(at), 2.0, f"p{i}") for i, at in enumerate(places))
    names = tuple(f"p{i}.{axis}" for i in range(3) for axis in "xyz")
    rows = Rows(plain.rows.effectors, plain.rows.actuators, names)
    return replace(plain, contacts=contacts, rows=rows, unilateral=np.zeros(2, dtype=bool))


def grip(fingers, table=None, first=GRASP, margin=1.2):
    held = Free(Box(HALF, t=CENTRE), CENTRE, np.array([0, 0, -WEIGHT, 0, 0, 0]), False)
    return GripPlant(fingers, ENDS, held, "coulomb", MU, CENTRE[None], first, margin, table)


@pytest.fixture(scope="module")
def scene(robot):
    """Plans on the energies of the rigid patches, and the FE plant."""
    problem = Problem(robot)
    patch = patch_of(contact_points(problem), turns=True)
    within = WithinPatch(*within_patch(robot, patch))
    model = Linear(state_of(FemPatch(robot, turns=True), np.zeros(8)).hessian)
    learned = [LearnedFinger(model, patch, within, turn, shift) for turn, shift in PLACES]
    object_ = RigidObject(CENTRE, False, np.array([0, 0, -WEIGHT]))
    holds = [Hold(f"r{i}", model, 2, 6, turn, shift, patch.origin) for i, (turn, shift) in enumerate(PLACES)]
    glued = Coupled(holds, object_)
    table = table_under(CENTRE, HALF, np.array([0, 0, -WEIGHT]))
    return learned, glued, table, grip([PlacedRobot(problem, *place) for place in PLACES], table)


@pytest.fixture(scope="module")
def plans(scene):
    learned, glued, table, _ = scene
    share = share_that_lifts(grip(learned), GRASP, 1.2)
    air = grip(learned)
    model = Gripping(air, glued, MU, 1.2, GRASP, taken(air, WEIGHT))
    return from_table(model, grip(learned, table), GRASP, 4e-3 * share)


def lifting(up):
    """The bars bend upwards by pushing with their lower cables more."""
    return GRASP + up * np.array([-1.0, 1.0, -1.0, 1.0])


def pilot(model, fe):
    limits = Limits(np.tile([-np.inf, np.inf], (4, 1)), np.tile([-0.2, 0.2], (4, 1)))
    search = Settings(iterations=20, tolerance=1e-6, step=0.05)
    alone = Pilot(model, "displacement", "equilibrium", limits, np.ones(3), np.full(4, 1e-3), search, preload=-0.004)
    return Grip.of(model, fe).pilot(alone)


def test_slopes_on_the_table_and_in_the_air_are_those_of_differences(plans):
    """To the side to which no point changes its mode: one that slips would stick on the way back. The slopes leave out
    how forces turn with the bars, below 0.2 % here."""
    h = 1e-7
    for at in (lifting(0.0), lifting(0.02)):
        model = replace(plans, before=None, at=None)
        model.settle(at)
        here = model.at_displacement(at)
        assert (here.borne > 0) == (at[0] == GRASP[0])
        sides = [
            np.array([(model.at_displacement(at + s * one).delta_e - here.delta_e) / s for one in np.eye(4)]).T
            for s in (h, -h)
        ]
        off = np.min([np.abs(here.effector_jacobian - side).max(axis=0) for side in sides], axis=0)
        assert off.max() <= 2e-3 * np.abs(sides).max()


def test_plans_stand_lift_and_put_down_and_finite_elements_follow(plans, scene):
    """Until the block leaves the table, the table bears what the bars do not; then they carry it with the margin."""
    fe = scene[3]
    model = replace(plans, before=None, at=None, margins=[], borne=[])
    goals = np.array([[65, 5, 5], [65, 5, 5.1], [65, 5, 5.2], [65, 5, 5.1], [65, 5, 5]])
    rest = np.array([*CENTRE, 0.0, 0.0])
    controller, found = Controller(pilot(model, fe), rest), []
    for goal in goals:
        plan = controller.tick(np.array([*goal, 0, 0])).plan
        assert plan.distance < 1e-3, (goal, plan.status)
        measured = fe.step(plan.delta_a)
        assert measured.status == "converged"
        found.append(measured.x_e[2] - CENTRE[2])
    np.testing.assert_allclose(found, [0, 0.1, 0.2, 0.1, 0], atol=0.03)  # plans know the bars' stiffness at rest alone
    assert model.borne[0] == pytest.approx(fe.borne[0], rel=0.05) and model.borne[0] > 0.5 * WEIGHT
    assert model.borne[1:4] == fe.borne[1:4] == [0.0, 0.0, 0.0]
    assert min(model.margins) >= 1.2 - 1e-3 and min(fe.margins) > 1.2


def test_the_least_squeeze_that_lifts_just_holds(scene):
    def hold(share=None):
        one = grip(scene[0], first=GRASP if share is None else share * GRASP)
        one._mu = 0.3
        return one

    least = share_that_lifts(hold(), GRASP, 1.2)
    assert 0.1 < least < 1
    for factor, holds in ((1.0, True), (0.7, False)):
        one = hold(factor * least)
        assert one.squeeze() == "converged"
        assert (one.bears() and one.slip_margin() >= 1.2) == holds


def test_what_no_squeeze_lifts_is_refused(scene):
    heavy = grip(scene[0])
    heavy._mu = 0.0
    with pytest.raises(SpecError, match="the robots cannot lift the object: no preload up to 3 times this one"):
        share_that_lifts(heavy, GRASP, 1.2)
    with pytest.raises(SpecError, match="nothing squeezes the object on its table"):
        share_that_lifts(heavy, 0 * GRASP, 1.2)
