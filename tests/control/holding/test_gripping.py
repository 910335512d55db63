"""Plans for two bars that squeeze a block between their ends, on a table: the same equations as finite elements."""

from copy import copy
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed import Rows
from cfem.condensed.coupling import Coupled, Holder, RigidObject, state_of
from cfem.constraint.contact import make_contact
from cfem.contact.obstacle import Box
from cfem.contact.step_status import StepStatus
from cfem.control.closed_loop.controller import Controller
from cfem.control.closed_loop.tick import Pilot
from cfem.control.holding.body import box_body
from cfem.control.holding.grasp import from_table, share_that_lifts, squeezed_off_table
from cfem.control.holding.gripping import STUCK, Grip, Gripping, _opened
from cfem.control.search.goal_search import SearchSettings, SearchStatus
from cfem.control.search.inverse import Limits
from cfem.control.search.optimality import Verdict
from cfem.core.errors import NumericalError, SpecError
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.held_patch import contact_points, patch_of
from cfem.equilibrium.contact.patch_compliance import within_patch
from cfem.equilibrium.contact.points import PlacedRobot, PointsState
from cfem.equilibrium.system.problem import Problem
from cfem.plant.fem_patch import FemPatch
from cfem.plant.grip_plant import GripPlant
from cfem.predict.contact.gripping_finger import LearnedFinger, WithinPatch

CENTRE, HALF, WEIGHT, MU = np.array([65.0, 5.0, 5.0]), np.array([5.0, 5.0, 5.0]), 2e-2, 0.8
FLIP = np.diag([-1.0, -1.0, 1.0])
PLACES = [(np.eye(3), np.zeros(3)), (FLIP, CENTRE - FLIP @ CENTRE)]
GRASP = np.full(4, -0.004)  # cables that push stretch the bars
ENDS, NAMES = np.array([0, 2, 4]), ("r0", "r1")


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


def grip(fingers, table=None, first=GRASP, margin=1.2, oriented=False):
    held = FreeObject(Box(HALF, t=CENTRE), CENTRE, np.array([0, 0, -WEIGHT, 0, 0, 0]), oriented, oriented=oriented)
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
    holds = [Holder(f"r{i}", model, 2, 6, turn, shift, patch.origin) for i, (turn, shift) in enumerate(PLACES)]
    glued = Coupled(holds, object_)
    table = box_body(CENTRE, HALF).table(np.array([0, 0, -WEIGHT]))
    return learned, glued.rows, table, grip([PlacedRobot(problem, *place) for place in PLACES], table)


@pytest.fixture(scope="module")
def plans(scene):
    learned, of_object, table, _ = scene
    return from_table(grip(learned, table), of_object, NAMES, MU, 1.2, GRASP, 4e-3)


def lifting(up):
    """The bars bend upwards by pushing with their lower cables more."""
    return GRASP + up * np.array([-1.0, 1.0, -1.0, 1.0])


def pilot(model, fe):
    limits = Limits(np.tile([-np.inf, np.inf], (4, 1)), np.tile([-0.2, 0.2], (4, 1)))
    search = SearchSettings(iterations=20, tolerance=1e-6, step=0.05)
    alone = Pilot(model, "displacement", "equilibrium", limits, np.ones(3), np.full(4, 1e-3), search, preload=-0.004)
    return Grip.of(model, fe).pilot(alone)


def test_slopes_on_the_table_and_in_the_air_are_those_of_differences(plans):
    """To the side to which no point changes its mode: one that slips would stick on the way back. The slopes leave out
    how forces turn with the bars, below 0.2 % here."""
    h = 1e-7
    for at in (lifting(0.0), lifting(0.02)):
        model = replace(plans, before=None, settled_at=None)
        model.settle(at)
        here = model.at_displacement(at)
        assert (here.borne > 0) == (at[0] == GRASP[0])
        sides = [
            np.array([(model.at_displacement(at + s * one).delta_e - here.delta_e) / s for one in np.eye(4)]).T
            for s in (h, -h)
        ]
        off = np.min([np.abs(here.effector_jacobian - side).max(axis=0) for side in sides], axis=0)
        assert off.max() <= 2e-3 * np.abs(sides).max()


def test_slopes_of_the_objects_rotation_are_those_of_differences(scene):
    """A block that can turn and is turned already. The slopes leave out how forces turn with the bars and the block,
    4 % of the rotation here."""
    learned, rows, _, _ = scene
    of_object = Rows(tuple(f"object.{axis}" for axis in ("x", "y", "z", "rx", "ry", "rz")), rows.actuators)
    model = Gripping(grip(learned, oriented=True), of_object, NAMES, MU, 1.2, GRASP)
    at, h = GRASP + 0.02 * np.array([-1.0, 1.0, 0.5, -0.5]), 1e-7
    model.settle(GRASP)
    model.settle(at)
    here = model.at_displacement(at)
    assert here.rows.effectors[3:6] == ("object.rx", "object.ry", "object.rz")
    assert np.linalg.norm(here.delta_e[3:6]) > 1e-3
    ways = [[(model.at_displacement(at + s * one).delta_e - here.delta_e) / s for s in (h, -h)] for one in np.eye(4)]
    off = [min(np.abs(here.effector_jacobian[:6, i] - way[:6]).max() for way in both) for i, both in enumerate(ways)]
    assert max(off) <= 5e-2 * np.abs([way[3:6] for both in ways for way in both]).max()


def test_plans_stand_lift_and_put_down_and_finite_elements_follow(plans, scene):
    """Until the block leaves the table, the table bears what the bars do not; then they carry it with the margin."""
    fe = scene[3]
    model = replace(plans, before=None, settled_at=None, margins=[], borne=[])
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
    learned, _, table, _ = scene

    def stands():
        one = grip(learned, table)
        one._mu = 0.3
        return one

    least = share_that_lifts(stands(), GRASP, 1.2)
    assert 0.1 < least < 1
    for factor, holds in ((1.0, True), (0.7, False)):
        air = squeezed_off_table(stands(), factor * least * GRASP)
        assert (air is not None and air.slip_margin() >= 1.2) == holds
        assert air is None or air.forces()[:, 2].sum() == pytest.approx(WEIGHT, rel=1e-6)


def test_what_no_squeeze_lifts_is_refused(scene):
    heavy = grip(scene[0], scene[2])
    heavy._mu = 0.0
    with pytest.raises(SpecError, match="the robots cannot lift the object: no preload up to 3 times this one"):
        share_that_lifts(heavy, GRASP, 1.2)
    with pytest.raises(SpecError, match="nothing squeezes the object on its table"):
        share_that_lifts(heavy, 0 * GRASP, 1.2)


def test_an_object_is_put_down_where_it_should_stand_and_let_go(plans, scene):
    """The plan of the learned bars, and finite elements: the block falls from 0.05 mm above its table, and stands."""
    fe = copy(scene[3])
    fe.reset()
    model = replace(plans, before=None, settled_at=None, margins=[], borne=[])
    controller = Controller(pilot(model, fe), np.array([*CENTRE, 0.0, 0.0]))
    above = controller.tick(np.array([65, 5, 5.05, 0, 0])).plan
    assert fe.step(above.delta_a).status == "converged" and fe.holds
    plan = controller.tick(np.array([*CENTRE, 0, 0]), let_go=True).plan
    assert plan.distance < 2e-3 and not plan.delta_a.any() and len(plan.via) == 2
    assert model.borne[-1] == pytest.approx(WEIGHT, rel=1e-3) and len(model.margins) == 1
    measured = fe.step(plan.delta_a, via=plan.via)
    assert measured.status == "converged" and not fe.holds
    np.testing.assert_allclose(measured.x_e[:3], CENTRE, atol=5e-3)
    assert fe.borne[-1] == pytest.approx(WEIGHT, rel=1e-2) and fe.pushes()[0].max() < 1e-2 * WEIGHT
    ended, moves = fe.alone()
    assert ended == "converged" and moves < 1e-4


def test_a_search_ends_after_so_many_steps_without_a_solution(plans, monkeypatch):
    """And the plan says that it stays where it is."""
    model, tried = replace(plans, before=None, settled_at=None, margins=[], borne=[]), []
    model.settle(lifting(0.02))
    controller = Controller(pilot(model, model.grip), np.array([*CENTRE, 0.0, 0.0]), start=lifting(0.02))
    none = PointsState(StepStatus.NO_MODE, (), (), None, np.zeros((0, 3)), None, 1, 0)
    monkeypatch.setattr("cfem.plant.grip_walk.grasp_step", lambda *rest: tried.append(1) or none)
    monkeypatch.setattr(type(model), "settle", lambda *rest: None)
    plan = controller.tick(np.array([65, 5, 5.3, 0, 0])).plan
    assert STUCK <= len(tried) < STUCK + 10 and plan.distance > 0.1 and plan.status is not SearchStatus.CONVERGED
    np.testing.assert_array_equal(plan.delta_a, lifting(0.02))
    tried.clear()
    with pytest.raises(NumericalError, match="steps had no solution"):
        model.at_displacement(lifting(0.03))
    assert not tried


def test_robots_that_find_no_way_to_put_down_stay_and_say_so(plans):
    def nowhere(*rest):
        raise NumericalError("the object slides off and finds no balance")

    model = replace(plans, before=None, settled_at=None, margins=[], borne=[])
    lost = replace(pilot(model, model.grip), put_down=nowhere)
    controller = Controller(lost, np.array([*CENTRE, 0.0, 0.0]))
    belief = controller.tick(np.array([*CENTRE, 0, 0]), let_go=True)
    assert belief.status == "the object slides off and finds no balance"
    assert belief.plan.status is SearchStatus.NO_ANSWER
    np.testing.assert_array_equal(belief.plan.delta_a, GRASP)


@pytest.mark.parametrize(
    ("clear", "said"), [(0.29, "the robots are 0.29 mm away from it"), (0.0, "still against it with up to 2 mN")]
)
def test_the_command_says_whether_the_robots_have_let_go(clear, said):
    plant = SimpleNamespace(clearance=lambda: clear, pushes=lambda: (np.array([0.0, 2e-3]), None))
    line = _opened(plant, "converged", 1e-5)
    assert said in line and "without them it moves by 1e-05 mm" in line
    assert "does NOT stand" in _opened(plant, "no balance", 0.0)


@pytest.mark.parametrize(("margin", "said"), [(None, "planned; the grasp"), (1.5, "planned, 1.5 asked for; the grasp")])
def test_the_margin_to_slip_is_told_with_what_was_asked_for(margin, said):
    learned = SimpleNamespace(margins=[2.0, 1.7], margin=margin, holds=3.0)
    fe = SimpleNamespace(margins=[1.6, 1.8], holds=True)
    spec = SimpleNamespace(object=SimpleNamespace(table=False))
    figures, (line,) = Grip.results(SimpleNamespace(model=learned, fe=fe), spec, [])
    assert line == f"grip: the margin to slip is 1.60 at least, 1.70 {said} holds 3 times the load"
    assert figures == {"margin": 1.6, "margin_planned": 1.7, "holds": 3.0}


@pytest.mark.parametrize(
    ("borne", "planned", "said"),
    [
        ([0.02, 0.0, 1e-9], [0.0, 0.0, 0.0], "at goals 0, 2 of 0 to 2, planned at no goal"),
        ([0.0, 0.0], [0.0, 0.1], "at no goal, planned at goals 1 of 0 to 1"),
    ],
)
def test_the_table_is_told_at_which_goals_it_bears_the_object(borne, planned, said):
    learned = SimpleNamespace(margins=[2.0], margin=None, holds=None, borne=planned, needs=0.125)
    alone = {"alone": lambda: ("converged", 1e-5), "clearance": lambda: 0.3, "pushes": lambda: (np.zeros(2), None)}
    spec = SimpleNamespace(
        object=SimpleNamespace(table=True), search=SimpleNamespace(preload=SimpleNamespace(unit="mm"))
    )
    for holds in (True, False):
        fe = SimpleNamespace(margins=[1.5], holds=holds, borne=borne, **alone)
        figures, lines = Grip.results(SimpleNamespace(model=learned, fe=fe), spec, [])
        assert lines[1] == f"table: the object stands on it {said}; a preload of 0.125 mm is enough to lift it"
        told = {"margin": 1.5, "margin_planned": 2.0, "holds": None, "borne": borne, "borne_planned": planned}
        told |= {"least_preload": 0.125}
        if not holds:
            told |= {"alone": {"status": "converged", "moves": 1e-5, "clearance": 0.3}}
            assert lines[2].startswith("let go: the object stands on its table")
        assert figures == told and len(lines) == 3 - holds


def test_goals_that_no_plan_reaches_are_told():
    learned = SimpleNamespace(margins=[], margin=None, holds=None)
    fe = SimpleNamespace(margins=[1.5], holds=True)
    rows = [
        {"trajectory": "up", "goal_index": i, "predicted_distance": 0.25, "status": "ended", "verdict": verdict.value}
        for i, verdict in enumerate((Verdict.REACHED, Verdict.OUT_OF_REACH))
    ]
    spec = SimpleNamespace(object=SimpleNamespace(table=False))
    figures, (grip, line) = Grip.results(SimpleNamespace(model=learned, fe=fe), spec, rows)
    assert line == "up, goal 1: no plan reaches it; the nearest ends 0.25 mm away (ended)"
    assert np.isnan(figures["margin_planned"]) and "nan planned" in grip
