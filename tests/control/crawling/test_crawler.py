"""A crawler of two hand-made legs: it rows along, rests in balance, and is refused where it cannot stand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.control.crawling.course import Course, headline, judged
from cfem.control.crawling.crawler import LegWeight, crawler_of
from cfem.control.crawling.gait import Gait
from cfem.core.errors import NumericalError, SpecError
from cfem.predict.contact.leg import LearnedLeg
from cfem.predict.loads.wrench_series import Held


def held(a):
    """The foot sweeps along x and comes down along -z, as the two actuators say; it yields by 1 mm/N."""
    J, none = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, -1.0]]), np.zeros((3, 3))
    e = np.array([J @ a, *J.T, *np.zeros((4, 3))])
    return Held(np.array([a @ a / 2, *a, *np.eye(2).ravel()]), e, np.array([np.eye(3), *[none] * 6]), None, 2)


def spec(**changes):
    base = SimpleNamespace(centre=[0.0, 0, 2], half_size=[3.0, 3, 2], weight=1.0, pads=0.01)
    ground = SimpleNamespace(point=[0.0, 0, 0], normal=[0.0, 0, 1], friction=0.5)
    whole = {"base": base, "ground": ground, "direction": [1.0, 0, 0], "pulls": (0.0, 1.0), "steps": 4, "cycles": 2}
    whole["distance"] = None
    return SimpleNamespace(**(whole | changes))


def crawler(about=None):
    foot = np.array([[0.0, 8.0, 0.5]])
    legs = [LearnedLeg(held, np.zeros(2, bool), foot * [1, side, 1], np.eye(3), np.zeros(3)) for side in (1, -1)]
    return replace(crawler_of(about or spec(), legs, ["one", "other"]), longest=0.25)


def commands(cycles=2, steps=8):
    """Both legs: press while they sweep back, lift while they sweep forth."""
    phi = 2 * np.pi * np.arange(1, steps + 1) / steps
    one = np.column_stack([0.5 + 0.5 * np.cos(phi), 0.45 + 0.35 * np.sin(phi)])
    return np.tile(np.hstack([one, one]), (cycles, 1))


def test_it_rows_itself_along_by_less_than_its_stroke_and_holds_its_course():
    walk = crawler().walk(commands(3), 0.5)
    assert walk.status == "converged" and len(walk.commands) == 24
    far = walk.per_cycle(8, np.array([1.0, 0, 0]))
    assert 0.05 < far < 1.0
    np.testing.assert_allclose(walk.base[:, 1], 0.0, atol=1e-6)
    for touch in walk.touches:
        assert touch.check.largest <= 1e-8
        lift = touch.posed.force[::3]
        assert lift.sum() == pytest.approx(1.0, rel=1e-2)  # the weight; the ground tilts by a little


def test_legs_with_a_weight_press_the_ground_by_it_and_row_farther():
    """Their centre of mass is their foot, which goes down by its share of the weight."""

    def twice(a):
        foot = held(a)
        e = np.hstack([foot.e, foot.e])
        return replace(foot, e=e, C=np.array([np.kron(np.ones((2, 2)), one) for one in foot.C]))

    light = crawler()
    down, at = np.array([0.0, 0, -0.2]), [leg.points[0] for leg in light.legs]
    legs = [replace(leg, held=twice, load=down) for leg in light.legs]
    heavy = crawler_of(spec(), legs, ["one", "other"], [LegWeight(0.2, one, np.eye(3)) for one in at])
    walks = [one.walk(commands(2), 0.5) for one in (light, heavy)]
    assert [one.status for one in walks] == ["converged"] * 2
    for touch in walks[1].touches:
        assert touch.posed.force[::3].sum() == pytest.approx(1.4, rel=1e-2) and touch.check.largest <= 1e-8
    far = [one.per_cycle(8, np.array([1.0, 0, 0])) for one in walks]
    assert far[1] > far[0] + 0.01
    one_heavy = crawler_of(spec(), [legs[0], light.legs[1]], ["one", "other"], [LegWeight(0.2, at[0], np.eye(3))])
    pads = one_heavy.walk(np.zeros((1, 4)), 0.5).touches[0]
    up = pads.posed.force[::3]
    places = np.concatenate([np.concatenate(at).reshape(-1, 3), one_heavy.pads.points])
    assert up.sum() == pytest.approx(1.2, rel=1e-3)
    assert up @ places[:, 1] == pytest.approx(0.2 * at[0][1], rel=1e-2)


def test_backwards_commands_go_backwards():
    ahead, back = (
        crawler().walk(one, 0.5).per_cycle(8, np.array([1.0, 0, 0])) for one in (commands(), commands()[::-1])
    )
    assert ahead > 0 > back


def test_legs_that_only_sweep_in_the_air_go_nowhere():
    u = commands()
    u[:, [1, 3]] = 0.0
    walk = crawler().walk(u, 0.5)
    assert abs(walk.per_cycle(8, np.array([1.0, 0, 0]))) < 1e-9


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"point": [0.0, 0, 1.0]}, "starts inside the ground: 'one' is 0.5 mm in it"),
        ({"point": [0.0, 0, 0.3]}, "starts inside the ground: its base is 0.3 mm in it"),
        ({"point": [0.0, 0, -1.0]}, "does not stand on the ground: it is 1 mm above it"),
        ({"normal": [0.1, 0, 1.0]}, "starts inside the ground|does not stand on the ground"),
    ],
)
def test_a_crawler_that_does_not_stand_on_the_ground_is_refused(changes, said):
    ground = SimpleNamespace(**({"point": [0.0, 0, 0], "normal": [0.0, 0, 1], "friction": 0.5} | changes))
    with pytest.raises(SpecError, match=said):
        crawler(spec(ground=ground))


ROWS = Gait(np.array([0.5, 0.45]), np.array([0.5, 0.35]), np.array([0.0, 0.25]))


def test_a_course_walks_a_gait_and_tells_of_it():
    course, one = Course(spec(), [False, False], 2), crawler()
    planned = course.plan(one, ROWS)
    assert len(planned.commands) == 8
    account = {"commands": 8, "points": {"stick": 3}, "law_residual": 1e-9}
    far = dict.fromkeys(("planned", "fe"), course.distance(planned))
    far["half_steps"] = course.distance(course.in_half_steps(one, planned))
    sweep, walks = [course.at_friction(0.8, ROWS, one, one)], {"planned": planned, "fe": planned}
    lines = headline(far, course.unit, sweep, walks, account, 0.5, 0)
    assert far["half_steps"] == pytest.approx(far["planned"], rel=0.2) and far["half_steps"] != far["planned"]
    assert "; half steps change the plan by " in lines[0]
    assert "mm a cycle planned" in lines[0] and "0 % apart, friction 0.5" in lines[0] and "OUTSIDE" not in lines[0]
    assert lines[1].startswith("friction 0.8, a cycle: ")
    assert lines[-1].endswith("contact points at their ends: 3 stick; the law is met to 1.0e-09")
    alone = [course.at_friction(mu, ROWS, one) for mu in (0.5, 0.8)]
    assert [row["planned"] for row in alone] == [course.distance(planned), sweep[0]["planned"]]
    assert alone[0]["half_steps"] == pytest.approx(far["half_steps"], rel=1e-9)
    said = headline(far, course.unit, sweep, walks, account, 0.5, 3, alone)
    assert said[2].startswith("planned alone") and "at 0.5," in said[2] and said[2].endswith("at 0.8")
    assert said[0].endswith("3 of 8 plans OUTSIDE what the model was trained on")


def test_a_stated_distance_is_walked_and_no_command_more():
    course, one = Course(spec(distance=0.3), [False, False], 2), crawler()
    planned = course.plan(one, ROWS)
    gone = (planned.base - planned.base[0]) @ course.direction
    assert gone[-1] >= 0.3 > gone[:-1].max() and course.unit == "mm"
    assert course.distance(planned) == gone[-1]
    np.testing.assert_array_equal(course.repeat(one, planned).base, planned.base)


def test_a_distance_that_the_gait_does_not_go_is_refused(monkeypatch):
    monkeypatch.setattr("cfem.control.crawling.course.MOST", 1)
    course = Course(spec(distance=30.0), [False, False], 2)
    with pytest.raises(NumericalError, match="in 1 cycles, not 30 mm"):
        course.plan(crawler(), ROWS)


@pytest.mark.parametrize(
    ("fe", "said"), [(1.9, None), (-0.1, "finite elements go -0.1 mm"), (np.nan, "finite elements do not finish")]
)
def test_a_plan_that_finite_elements_do_not_walk_is_called_poor(fe, said):
    found = judged({"planned": 2.0, "half_steps": 2.3, "fe": fe}, "mm a cycle")
    assert (said is None and not found) or said in found[0]["what"]


@pytest.mark.parametrize(
    ("halved", "said"),
    [(2.3, None), (1.5, "it goes 2 mm, in half steps 1.5"), (np.nan, "in half steps it does not come to its end")],
)
def test_a_plan_that_depends_on_its_steps_is_called_poor(halved, said):
    found = judged({"planned": 2.0, "half_steps": halved, "fe": 2.0}, "mm")
    assert (said is None and not found) or said in found[0]["what"]


def test_a_leg_near_buckling_is_called_poor():
    said = judged({"planned": 2.0, "half_steps": 2.0, "fe": 2.0}, "mm", ratio=0.6)
    assert len(said) == 1 and "buckling" in said[0]["what"]


def test_a_walk_that_ended_for_another_reason_says_so_and_not_that_it_is_too_short(monkeypatch):
    course, one = Course(spec(distance=30.0), [False, False], 2), crawler()
    stopped = replace(course.walk(one, ROWS), status="a leg found no state")
    monkeypatch.setattr(type(one), "walk", lambda *_: stopped)
    assert course.plan(one, ROWS).status == "a leg found no state"
