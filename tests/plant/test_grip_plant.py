"""Two bars that carry a block which they only touch, as a plant."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.blocks import bar

from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Box
from cfem.contact.step_status import StepStatus
from cfem.control.holding.body import WITHIN, box_body
from cfem.equilibrium.contact.grasp import FreeObject
from cfem.equilibrium.contact.points import PlacedRobot
from cfem.equilibrium.system.problem import Problem
from cfem.plant.grip_plant import GripPlant

REST = np.array([30.0, 5.0, 9.0])
FLIP = np.diag([1.0, -1.0, -1.0])
CENTRE = REST + [0, 0, 3.0]


def plant(load=(0.0, 0.0, 0.0), **more):
    problem = Problem(bar(element="hex8", cables=2, contact=True))
    fingers = [PlacedRobot(problem, np.eye(3), np.zeros(3)), PlacedRobot(problem, FLIP, CENTRE - FLIP @ CENTRE)]
    held = FreeObject(Box(np.array([4.0, 4.0, 3.0]), t=CENTRE), CENTRE, np.array([*load, 0, 0, 0]), False)
    return GripPlant(fingers, np.array([0, 2, 4]), held, "coulomb", 0.8, CENTRE[None], **more)


def squeeze(up, down):
    return np.array([-up, up, -down, down])


def test_a_long_command_goes_in_steps_and_ends_where_short_ones_do():
    one, many = plant(), plant()
    far = one.step(squeeze(1.8, 1.6))
    for share in (0.5, 1.0):
        near = many.step(share * squeeze(1.8, 1.6))
    assert far.status == near.status == "converged" and one.steps >= 2
    np.testing.assert_allclose(far.x_e, near.x_e, atol=1e-4)
    assert far.x_e[2] > CENTRE[2] and one.worst <= 1e-8
    assert one.account()["points"]["open"] == 0 and one.failures == 0
    np.testing.assert_allclose(one.x[-1], far.x_e, atol=1e-12)


def test_what_cannot_be_held_ends_where_it_could_and_says_so():
    weak = plant(load=(0.0, 1e-3, 0.0))
    held = weak.step(squeeze(0.3, 0.3))
    assert held.status == "converged"
    dropped = weak.step(squeeze(-0.3, -0.3))
    assert "of the way" in dropped.status and weak.failures == 1
    assert np.isfinite(dropped.x_e).all()


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_the_picture_has_the_block_last(share):
    shown = plant()
    if share:
        shown.step(squeeze(0.3, 0.3))
    assert shown.x.shape[1] == 3 and np.abs(shown.x[-1] - CENTRE).max() < 0.2


def steps_of(monkeypatch, works, goal, **more):
    """Shares of the way to `goal` (mm) of one actuator that are tried where `works` says whether one can be gone."""
    tried = []

    def go(self, u, load):
        tried.append(float(u[1]))
        if not works(tried[-1], self.at[1]):
            return StepStatus.NO_MODE.value
        self.at = u
        return StepStatus.CONVERGED.value

    monkeypatch.setattr(GripPlant, "_go", go)
    one = plant(**more)
    return tried, one.towards(np.array([0.0, goal, 0.0, 0.0])), one


def test_no_quasi_static_step_is_longer_than_a_millimetre(monkeypatch):
    tried, said, _ = steps_of(monkeypatch, lambda to, at: True, 4.0)
    assert said == "converged"
    np.testing.assert_allclose(tried, [1.0, 2.0, 3.0, 4.0])


def test_steps_of_chambers_are_as_long_as_is_stated(monkeypatch):
    tried, said, _ = steps_of(monkeypatch, lambda to, at: True, 240.0, longest=60.0)
    assert said == "converged"
    np.testing.assert_allclose(tried, [60.0, 120.0, 180.0, 240.0])


def test_a_step_that_fails_is_halved_and_then_doubled_up_to_a_millimetre(monkeypatch):
    tried, said, _ = steps_of(monkeypatch, lambda to, at: to > 1 or to - at <= 0.5, 4.0)
    assert said == "converged"
    np.testing.assert_allclose(tried, [1.0, 0.5, 1.5, 2.5, 3.5, 4.0])


def test_a_way_that_ends_is_left_where_it_ended(monkeypatch):
    tried, said, one = steps_of(monkeypatch, lambda to, at: to <= 1.0, 2.0)
    assert said == f"{StepStatus.NO_MODE.value}, at 50 % of the way" and one.at[1] == 1.0
    np.testing.assert_allclose(tried, [1.0, *(1.0 + 0.5 ** np.arange(6))])


@pytest.mark.parametrize(
    ("longest", "held", "stops"),
    [
        (1.0, 0.3, [0.2, 0.1, 0.0]),
        (1.0, 0.25, [1 / 6, 1 / 12, 0.0]),
        (60.0, -24.0, [-18.0, -12.0, -6.0, 0.0]),  # mm^3
    ],
)
def test_robots_let_go_in_equal_steps_of_a_tenth_of_the_longest(monkeypatch, longest, held, stops):
    """The first step is no longer than the others, and the last ends at rest."""
    one, tried = plant(table=object(), longest=longest), []
    one.at = np.array([0.0, held, held / 2, 0.0])

    def go(self, u, load):
        tried.append(u)
        return "converged"

    monkeypatch.setattr(GripPlant, "_go", go)
    assert one.towards(np.zeros(4)) == "converged"
    np.testing.assert_allclose(tried, np.outer(stops, [0.0, 1.0, 0.5, 0.0]), atol=1e-12)


def test_robots_that_cannot_let_go_stay_where_that_ended(monkeypatch):
    """Where a step has no solution the object slides; where it finds no balance then, nothing goes on."""
    one, tried, slid = plant(table=object()), [], []
    one.at = np.array([0.0, 0.4, 0.0, 0.0])
    monkeypatch.setattr(GripPlant, "_go", lambda self, u, load: tried.append(u[1]) or "no")
    monkeypatch.setattr(
        GripPlant, "_slide", lambda self, u: slid.append(u[1]) or ("no" if u[1] < 0.15 else "converged")
    )
    assert one.towards(np.zeros(4)) == "no"
    np.testing.assert_allclose(tried, [0.3, 0.2, 0.1])
    np.testing.assert_allclose(slid, tried)


@pytest.mark.parametrize(
    ("modes", "moved", "commanded", "longest", "said"),
    [
        ((Mode.OPEN, Mode.OPEN), 0.01, 0.3, 1.0, "let go"),
        ((Mode.STICK, Mode.OPEN), 9.0, 0.3, 1.0, "jump by 9 mm"),
        ((Mode.STICK, Mode.OPEN), 9.0, 18.0, 60.0, "jump by 9 mm"),  # mm^3
        ((Mode.STICK, Mode.OPEN), 2.0, 0.3, 1.0, "converged"),
        ((Mode.STICK, Mode.OPEN), 9.0, 0.0, 1.0, "converged"),  # a load that is handed over
    ],
)
def test_a_solution_that_is_no_step_of_the_object_is_refused(monkeypatch, modes, moved, commanded, longest, said):
    """Without load an object that nothing touches is in balance wherever it is."""
    one = plant(longest=longest)
    one.last = SimpleNamespace(modes=(Mode.STICK, Mode.STICK), around=SimpleNamespace(x=np.zeros(3)))
    there = SimpleNamespace(
        modes=modes,
        around=SimpleNamespace(x=np.array([0.0, moved, 0.0])),
        converged=True,
        status=StepStatus.CONVERGED,
        iterations=1,
    )
    monkeypatch.setattr("cfem.plant.grip_walk.grasp_step", lambda *rest: there)
    before = one.last
    assert said in one._go(np.array([0.0, commanded, 0.0, 0.0]), 1.0)
    assert (one.last is there) == (said == "converged") and (one.last is before) == (said != "converged")


def test_the_robots_take_the_load_over_after_they_have_grasped():
    """The block sags under its load, the robots balance it, and each grip says what it has left."""
    problem = Problem(bar(element="hex8", cables=2, contact=True))
    fingers = [PlacedRobot(problem, np.eye(3), np.zeros(3)), PlacedRobot(problem, FLIP, CENTRE - FLIP @ CENTRE)]
    held = FreeObject(Box(np.array([4.0, 4.0, 3.0]), t=CENTRE), CENTRE, np.array([2e-3, 0, 0, 0, 0, 0]), False)
    grasp = squeeze(0.5, 0.5)
    one = GripPlant(fingers, np.array([0, 2, 4]), held, "coulomb", 0.8, CENTRE[None], grasp, margin=1.5)
    assert one.load == 0.0
    got = one.step(grasp)
    assert got.status == "converged" and one.load == 1.0 and got.x_e.shape == (5,)
    normal, friction = one.pushes()
    np.testing.assert_allclose(friction.sum(axis=0), [2e-3, 0, 0], atol=1e-9)  # on the robots
    np.testing.assert_allclose(one.forces().sum(axis=0), [-2e-3, 0, 0], atol=1e-9)
    np.testing.assert_allclose(got.x_e[3:], 0.8 * normal - 1.5 * np.linalg.norm(friction, axis=1), atol=1e-12)
    assert one.margins == [pytest.approx((0.8 * normal / np.linalg.norm(friction, axis=1)).min())]
    one.reset()
    assert one.last is None and one.load == 0.0 and not one.at.any()
    assert one.take(1.0) != "converged" and one.load == 0.0  # nothing squeezes it


def on_table(grasp=(0.1, 0.3), load=-5e-3):
    """The robots about a block on its table, not yet moved, and the load (N) along z."""
    problem, load = Problem(bar(element="hex8", cables=2, contact=True)), np.array([0, 0, load, 0, 0, 0])
    fingers = [PlacedRobot(problem, np.eye(3), np.zeros(3)), PlacedRobot(problem, FLIP, CENTRE - FLIP @ CENTRE)]
    half = np.array([4.0, 4.0, 3.0])
    held = FreeObject(Box(half, t=CENTRE), CENTRE, load, False)
    table = box_body(CENTRE, half).table(load[:3])
    one = GripPlant(fingers, np.array([0, 2, 4]), held, "coulomb", 0.8, CENTRE[None], squeeze(*grasp), table=table)
    return one, table


def test_an_object_stands_on_its_table_until_it_is_lifted():
    """The table bears the load at first, then the robots do; what the table bears and they push balances the load."""
    one, table = on_table()
    np.testing.assert_allclose(table.points[:, 2], CENTRE[2] - 3.0)
    stands = one.step(squeeze(0.1, 0.3))
    assert stands.status == "converged" and one.load == 1.0
    assert one.borne[0] > 5e-3 and abs(stands.x_e[2] - CENTRE[2]) < 1e-3  # pressed down by the upper bar as well
    assert one.borne[0] + one.forces()[:, 2].sum() == pytest.approx(5e-3, abs=1e-9)
    before, steps = one.last, one.steps
    air = one.off_table()  # nothing of the load is with the robots: they take it over in quarters, from none on
    assert one.last is before and one.table is table and air.table is None
    assert air.steps - steps == 5 and air.load == 1.0
    assert len(air.last.solved) == 2 and len(air.last.modes) == one.parts[-1][1]
    assert air.forces()[:, 2].sum() == pytest.approx(5e-3, abs=1e-9)
    lifted = one.step(squeeze(1.8, 1.2))
    assert lifted.status == "converged" and lifted.x_e[2] > CENTRE[2] + 0.1
    assert one.borne[1] == 0.0 and one.forces()[:, 2].sum() == pytest.approx(5e-3, abs=1e-9)
    assert one.x.shape[1] == 3
    steps, there = one.steps, one.last.around.x
    air = one.off_table()  # all of it is: one step, which changes nothing
    assert air.steps - steps == 1
    np.testing.assert_allclose(air.last.around.x, there, atol=1e-6)


def test_what_robots_bear_of_a_load_begins_where_the_table_leaves_it(monkeypatch):
    """Shares that are tried, from what the table bears: of 5 mN."""
    one, _ = on_table()
    assert one.step(squeeze(0.1, 0.3)).status == "converged"
    tried = []
    monkeypatch.setattr(GripPlant, "_go", lambda self, u, load: tried.append(float(load)) or "converged")
    for borne, shares in ((2e-3, [0.6, 0.8, 1.0]), (0.0, [1.0]), (9e-3, [0.0, 0.25, 0.5, 0.75, 1.0])):
        monkeypatch.setattr(GripPlant, "on_table", lambda self, borne=borne: borne)
        tried.clear()
        assert one.off_table() is not None
        np.testing.assert_allclose(tried, shares, atol=1e-12)
    monkeypatch.setattr(GripPlant, "_go", lambda self, u, load: "converged" if load < 0.6 else "no")
    assert one.off_table() is None


def test_the_margin_to_slip_is_that_of_the_robot_that_has_the_least(monkeypatch):
    one = plant()
    for normal, friction, margin in (
        ([2.0, 3.0], [[0.4, 0, 0], [0, 0.3, 0.4]], 0.8 * 2.0 / 0.4),
        ([2.0, 3.0], [[0.4, 0, 0], [0, 0.9, 1.2]], 0.8 * 3.0 / 1.5),
        ([2.0, 0.0], [[0.4, 0, 0], [0, 0, 0]], 0.0),
        ([2.0, 2.0], [[0, 0, 0], [0, 0, 0]], 0.8 / 1e-8),
    ):
        pair = np.array(normal), np.array(friction)
        monkeypatch.setattr(one, "pushes", lambda pair=pair: pair)
        assert one.slip_margin() == pytest.approx(margin)


def test_an_object_that_nothing_holds_slides_down_faster_and_faster_to_its_table():
    """A drag lets 5 mN go by 0.05 mm in a first step and by twice that in the next: it falls by 0.139 mm."""
    one, _ = on_table()
    one.step(squeeze(0.1, 0.3))
    one.step(squeeze(1.8, 1.2))
    begin, steps, opened, heights = one.last.around.x.copy(), one.steps, squeeze(-0.3, -0.3), []
    found = one._found

    def kept(*asked):
        state, fingers = found(*asked)
        heights.append(state.around.x[2] - begin[2])
        return state, fingers

    one._found = kept
    assert one._slide(opened) == "converged"
    np.testing.assert_allclose(heights, [-0.05, -begin[2], -begin[2], -begin[2]], atol=2e-5)
    assert one.steps - steps == 4  # two that fall, one that stays, and the balance
    np.testing.assert_allclose(one.last.around.x[:2], begin[:2], atol=1e-6)
    np.testing.assert_array_equal(one.at, opened)
    assert one.on_table() == pytest.approx(5e-3, rel=1e-6) and np.abs(one.forces()).max() < 1e-10
    gaps = np.abs(one._points(one.last) - (CENTRE + one.last.around.x))[:, 2] - 3.0  # outside the block's sides
    assert one.clearance() == pytest.approx(gaps.min(), abs=1e-9) and gaps.min() > 0.1


def slide_of(monkeypatch, converges, moved, balances=lambda: True):
    """A slide of a block that may turn, whose steps converge and go (6,) as is said: how it ended, and mobilities."""
    one, _ = on_table()
    one._held = replace(one._held, turns=True)
    one.last, one.at, asked = "before", np.zeros(4), []

    def step(u, load, mobility):
        asked.append(mobility)
        return SimpleNamespace(converged=next(converges), around=SimpleNamespace(gone=next(moved))), one.fingers

    monkeypatch.setattr(one, "_found", step)
    monkeypatch.setattr(one, "_go", lambda u, load: "converged" if balances() else "no")
    return one._slide(np.ones(4)), np.array(asked), one


def test_a_slide_is_slower_after_a_step_that_fails_and_turns_as_its_size_has_it(monkeypatch):
    size = np.sqrt(3.0**2 + 2 * (WITHIN * 4.0) ** 2)  # mm, from the centre to the table's points
    turned = (np.array([0, 0, 0, angle / size, 0, 0]) for angle in (0.9, 0.051, 0.049))
    status, asked, one = slide_of(monkeypatch, iter([True, False, True, True]), iter([*[next(turned)], None, *turned]))
    assert status == "converged"
    linear = 0.05 / 5e-3 * np.array([1, 2, 0.5, 1])
    np.testing.assert_allclose(asked[:, :3], linear[:, None].repeat(3, axis=1))
    np.testing.assert_allclose(asked[:, 3:], linear[:, None].repeat(3, axis=1) / size**2)
    np.testing.assert_array_equal(one.at, np.ones(4))


def test_a_slide_that_finds_no_balance_ends_where_it_began(monkeypatch):
    still = iter([np.zeros(6)] * 99)
    status, asked, one = slide_of(monkeypatch, iter([True] * 99), still, balances=lambda: False)
    assert status == "the object slides off and finds no balance" and len(asked) == 60
    assert one.last == "before" and not one.at.any()
