"""The stroke found by solving ends where the body is bent or strained to its limit, or has softened."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import bar, block

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.cavity import enclosed, make_cavity
from cfem.constraint.effector import make_effector
from cfem.core.errors import SpecError
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation, displacement
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.init import stroke
from cfem.init.question import answer
from cfem.init.stroke import Stroke, equalised, find_strokes
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, boundary_facets


@pytest.fixture(scope="module")
def found():
    robot = bar("tet4", divisions=(12, 2, 2))
    return robot, find_strokes(robot)


def test_at_its_stroke_an_actuator_is_at_a_limit(found):
    robot, each = found
    assert len(each) == 2 and all(one.force > 0 for one in each)
    problem = Problem(robot)
    target = Actuation(np.eye(2)[[1]], np.array([each[1].reach]), np.zeros(2))  # the shorter of two that are alike
    ended = solve(problem, target, slack=False, wanted=Wanted(condense=False))
    tip = robot.X[:, 0] > 54
    X, x = robot.X[tip], ended.state.x[tip]
    turn = Rotation.align_vectors(x - x.mean(axis=0), X - X.mean(axis=0))[0].magnitude()
    at = problem.evaluate(ended.state.x, ended.state.pressure, 1.0)
    strain = stroke.Strain(8.0).value(problem, at)
    assert max(turn / (np.pi / 2), strain / 0.5) == pytest.approx(1, abs=0.1)
    assert ended.state.lam[1] == pytest.approx(each[1].force, rel=0.1)


def test_the_limit_is_said(found):
    assert {one.why for one in found[1]} <= {"turns the tip by 90 degrees", "strained by 50 %"}


def test_a_lower_limit_ends_the_stroke_earlier(found, monkeypatch):
    monkeypatch.setattr(stroke, "STRAIN", 0.02)
    (first,) = find_strokes(bar("tet4", divisions=(12, 2, 2), cables=1))
    assert first.reach < 0.6 * found[1][0].reach and first.why == "strained by 2 %"


@pytest.fixture
def together(monkeypatch):
    """Strokes of two actuators that go 4 mm alone, where all at once reach the shares for which `borne` is true."""

    def strokes_where(borne):
        def solved(problem, actuation, **how):
            assert float((actuation.C @ [4.0, 4.0])[0]) == pytest.approx(1.0)
            share = actuation.target[0]
            return SimpleNamespace(status=stroke.Status.CONVERGED if borne(share) else stroke.Status.OUT_OF_REACH)

        monkeypatch.setattr(stroke, "_alone", lambda *given: stroke.Stroke(4.0, 1.0, "alone"))
        monkeypatch.setattr(stroke, "_meets_itself", lambda *given: False)
        monkeypatch.setattr(stroke, "solve", solved)
        return [each.reach / 4.0 for each in find_strokes(bar("tet4", divisions=(6, 1, 1)))]

    return strokes_where


@pytest.mark.parametrize("most", [0.01, 0.31, 0.5, 0.74, 0.97])
def test_strokes_are_as_much_as_all_actuators_bear_together(together, most):
    """To an eighth of the step between two shares that are tried."""
    first, second = together(lambda share: share <= most)
    assert first == second and most - 0.02 <= first <= max(most, 0.02)


def test_all_together_unlike_actuators_are_pulled_in_the_proportion_of_their_forces(monkeypatch):
    """So that one of a tenth of the other's stroke goes no farther beyond it than the other: both rows end at mu."""
    pulled = []

    def solved(problem, actuation, **how):
        pulled.append(actuation)
        return SimpleNamespace(status=stroke.Status.CONVERGED)

    alone = iter([Stroke(4.0, 2.0, "alone"), Stroke(0.4, 3.0, "alone")])
    monkeypatch.setattr(stroke, "_alone", lambda *given: next(alone))
    monkeypatch.setattr(stroke, "_meets_itself", lambda *given: False)
    monkeypatch.setattr(stroke, "solve", solved)
    assert [each.reach for each in find_strokes(bar("tet4", divisions=(6, 1, 1)))] == [4.0, 0.4]
    assert pulled[-1].C[0, 1] / pulled[-1].C[0, 0] == pytest.approx(3 / 2)
    assert float((pulled[-1].C @ [4.0, 0.4])[0]) == pytest.approx(pulled[-1].target[0]) == 1.0


def test_strokes_that_are_nearly_alike_are_the_shorter_and_others_are_kept():
    found = [Stroke(reach, 1.0, "x") for reach in (10.0, 11.9, 30.0, 12.0, 33.0, 2.0)]
    assert [each.reach for each in equalised(found, ["mm"] * 6)] == [10, 10, 30, 10, 30, 2]
    units = ["mm", "mm^3", "mm", "mm", "mm", "mm^3"]
    assert [each.reach for each in equalised(found, units)] == [10, 11.9, 30, 10, 30, 2]
    assert equalised([], []) == []


def test_strokes_that_end_suddenly_are_compared_before_they_are_shortened(monkeypatch):
    """Alike cables, of which one folds on this mesh: the other would on another mesh."""
    alone = iter([Stroke(10.0, 2.0, "35 %"), Stroke(9.0, 1.8, "folds", sudden=True)])
    monkeypatch.setattr(stroke, "_alone", lambda *given: next(alone))
    monkeypatch.setattr(stroke, "_up_to", lambda reached: 1.0)
    assert [each.reach for each in find_strokes(bar("tet4", divisions=(12, 2, 2), cables=2))] == [7.2, 7.2]


def test_strokes_are_not_cut_where_all_go_together(together):
    assert together(lambda share: True) == [1, 1]


def test_a_share_beyond_one_that_fails_does_not_count(together):
    """As beyond the load at which a body buckles, where another branch may be found or not."""
    assert together(lambda share: share < 0.65 or share > 0.85) == pytest.approx([0.64, 0.64], abs=0.02)


def slit(width: float) -> Robot:
    """A bar of 60 x 10 x 10 mm but for a slit across it, `width` mm wide and 7.5 mm deep, over which a cable leads."""
    plain = bar("tet4", divisions=(12, 2, 4), cables=1)
    X, cells = plain.X.copy(), plain.body.mesh.cells
    middles = X[cells].mean(axis=1)
    cells = cells[~((middles[:, 0] > 25) & (middles[:, 0] < 30) & (middles[:, 2] < 7.5))]
    X[:, 0] = np.interp(X[:, 0], [0, 25, 30, 60], [0, 25, 25 + width, 60])
    used, numbers = np.unique(cells, return_inverse=True)
    cells = numbers.reshape(cells.shape)
    mesh = Mesh(X[used], cells, boundary_facets(cells))
    points = [attach(mesh, np.array([x, 5.0, 1.0]), 2.0, "cable-0") for x in (15.0, 35.0, 55.0)]
    body = make_body(mesh, ELEMENTS["tet4"], Material(LAWS["neo-hookean"], 1.0, 0.45))
    return replace(
        plain,
        body=body,
        fixed=np.flatnonzero(mesh.X[:, 0] < 1e-9),
        actuators=(make_cable(points, np.array([0.0, 5.0, 1.0]), "cable-0"),),
        effectors=(make_effector(mesh, np.array([60.0, 5.0, 5.0]), 2.0, 10.0, "tip"),),
    )


def fork() -> Robot:
    """Two legs of 60 x 6 x 6 mm on a palm, 30 mm apart, a cable along the outer side of each; the left leg's end is
    watched."""
    whole = block((42.0, 6.0, 70.0), (14, 2, 14))
    x, _, z = whole.X[whole.cells].mean(axis=1).T
    used, numbers = np.unique(whole.cells[(z < 10) | (x < 6) | (x > 36)], return_inverse=True)
    cells = numbers.reshape(-1, 4)
    mesh = Mesh(whole.X[used], cells, boundary_facets(cells))

    def cable(name, x):
        points = [attach(mesh, np.array([x, 3.0, z]), 2.0, name) for z in (15.0, 40.0, 65.0)]
        return make_cable(points, np.array([x, 3.0, 0.0]), name)

    return replace(
        bar("tet4", cables=2),
        body=make_body(mesh, ELEMENTS["tet4"], Material(LAWS["neo-hookean"], 1.0, 0.45)),
        fixed=np.flatnonzero(mesh.X[:, 2] < 1e-9),
        actuators=(cable("cable-0", 1.0), cable("cable-1", 41.0)),
        effectors=(make_effector(mesh, np.array([3.0, 3.0, 70.0]), 2.0, 10.0, "tip"),),
    )


def test_the_legs_of_a_gripper_bend_as_far_whichever_of_them_is_watched():
    watched, other = find_strokes(fork())
    assert other.reach == watched.reach and watched.why == other.why == "turns the end of its cable by 90 degrees"


def test_a_slit_that_closes_ends_the_stroke():
    """The slit's faces stand on their edges, 1 mm apart: the cable is shortened by hardly more than that."""
    (narrow,), (wide,) = find_strokes(slit(1.0)), find_strokes(slit(3.0))
    assert narrow.why == "beyond it, the body meets itself" and narrow.force > 0
    assert 0.4 < narrow.reach < 2.4 and narrow.reach < 0.7 * wide.reach
    problem = Problem(slit(1.0))
    states = (solve(problem, displacement(np.array([share * narrow.reach])), slack=False) for share in (1.2, 1.6))
    assert [stroke._meets_itself(problem, state) for state in states] == [False, True]  # it ends well before


class TestWhetherWallsPushEachOther:
    def of(self, robot, typed=None):
        questions = []

        def ask(question):
            questions.append(question)
            return answer(question, typed)

        strokes, contact = stroke.with_contact(robot, ask, typed is not None, lambda count: None)
        return strokes[0], contact, [question.default for question in questions]

    def test_it_is_suggested_where_a_slit_ends_the_stroke(self):
        (without,), (pushed, contact, asked) = find_strokes(slit(1.0)), self.of(slit(1.0))
        assert asked == ["yes"] and contact.value == "yes" and "narrow gap" in contact.guess
        assert not pushed.meets and pushed.reach > stroke.WORTH * without.reach
        stays, contact, asked = self.of(slit(1.0), "no")
        assert stays == without and contact.value == "no" and asked == ["yes"]

    def test_nobody_is_asked_where_nothing_meets_or_no_walls_face_each_other(self):
        assert self.of(bar("tet4", divisions=(12, 2, 2), cables=1))[1:] == (None, [])
        far, contact, asked = self.of(slit(4.0))
        assert far.meets and (contact, asked) == (None, [])
        with pytest.raises(SpecError, match=r"no walls of the body face each other within 3 mm"):
            self.of(slit(4.0), "yes")


def test_a_body_that_touches_itself_from_the_start_has_the_stroke_of_one_that_does_not(monkeypatch):
    robot = bar("tet4", divisions=(12, 2, 2), cables=1)
    (clear,) = find_strokes(robot)
    monkeypatch.setattr(stroke, "_meets_itself", lambda *given: True)
    (first,) = find_strokes(robot)
    assert first.reach == pytest.approx(clear.reach, rel=0.05)
    assert first.why == f"{clear.why}; its surface touches itself from the start, which is left out of account"


def column(off: float) -> Robot:
    """A bar whose one cable leads through the air to its end, `off` mm beside its middle: it is pressed, then gives way
    sideways."""
    plain = bar("tet10p0", divisions=(8, 1, 1), cables=1)
    end = attach(plain.body.mesh, np.array([55.0, 5.0, 5.0 - off]), 4.0, "cable-0")
    return replace(plain, actuators=(make_cable([end], np.array([0.0, 5.0, 5.0 - off]), "cable-0"),))


def stiffness(robot: Robot, amount: float) -> float:
    """N/mm of the cable, by the forces on either side."""
    states = [
        solve(Problem(robot), Actuation(np.eye(1), np.array([near]), np.zeros(1)), slack=False)
        for near in (amount - 0.01, amount + 0.01)
    ]
    return float(np.diff([ended.state.lam[0] for ended in states])[0] / 0.02)


@pytest.mark.parametrize("off", [0.2, 1.0])
def test_a_limb_that_gives_way_ends_the_stroke_at_a_quarter_of_its_stiffness(off):
    robot = column(off)
    (given_way,) = find_strokes(robot)
    assert given_way.why == "softened to 25 % of its stiffness" and given_way.force > 1
    assert stiffness(robot, given_way.reach) == pytest.approx(stiffness(robot, 0.55) / 4, rel=0.15)


def test_a_cable_that_bends_a_body_from_the_start_is_not_ended_by_softening(found):
    assert not any("softened" in each.why for each in found[1])


def balloon() -> Robot:
    """A cube of 16 mm, held at x = 0, with a closed room behind walls of 2 mm."""
    mesh = block((16.0, 16.0, 16.0), (8, 8, 8))
    away = np.abs(mesh.X[mesh.cells].mean(axis=1) - 8.0)
    used, cells = np.unique(mesh.cells[(away > 6.0).any(axis=1)], return_inverse=True)
    cells = cells.reshape(-1, 4)
    mesh = Mesh(mesh.X[used], cells, boundary_facets(cells))
    return replace(
        bar("tet4", divisions=(6, 1, 1), cables=1),
        body=make_body(mesh, ELEMENTS["tet4"], Material(LAWS["neo-hookean-log"], 1.0, 0.45)),
        fixed=np.flatnonzero(mesh.X[:, 0] < 1e-9),
        actuators=(make_cavity(mesh.X, mesh.facets[enclosed(mesh, np.array([8.0, 8, 8]))], "room"),),
        effectors=(make_effector(mesh, np.array([16.0, 8.0, 8.0]), 4.0, 10.0, "tip"),),
        rows=Rows(("tip.x", "tip.y", "tip.z"), ("room",)),
        length=16.0,
    )


def test_a_chamber_stays_before_its_largest_pressure(monkeypatch):
    """Beyond it, two volumes belong to one pressure, and W changes its sign through infinity."""
    monkeypatch.setattr(stroke, "STRAIN", 1e3)
    robot = balloon()
    (first,) = find_strokes(robot)
    assert first.why == "beyond it, the pressure falls while the volume grows"
    problem, state, volumes, pressures = Problem(robot), None, first.reach * np.linspace(0.7, 1.5, 9), []
    for volume in volumes:
        ended = solve(problem, Actuation(np.eye(1), np.array([volume]), np.zeros(1)), state, state, slack=False)
        pressures.append(ended.state.lam[0])
        state = ended.state
    assert np.interp(first.reach, volumes, pressures) == pytest.approx(first.force, rel=0.3)
    assert 1.15 < volumes[np.argmax(pressures)] / first.reach < 1.4 and pressures[-1] < max(pressures)


def test_the_top_between_two_states_is_that_of_the_cubic_through_them():
    """p = V - V^3 / 12 has its top at V = 2."""
    path = [(volume, volume - volume**3 / 12, 1 - volume**2 / 4) for volume in (1.5, 2.5)]
    assert stroke._largest(*path) == pytest.approx((2.0, 4 / 3))


def test_all_chambers_together_stay_before_the_largest_of_their_pressures(monkeypatch):
    """Two of the compliance [[1, w], [w, 1]], where w falls below -1 at 0.6 of the way."""

    def solved(problem, actuation, **how):
        w = -actuation.target[0] / 0.6
        condensed = SimpleNamespace(W_aa=np.array([[1.0, w], [w, 1.0]]))
        return SimpleNamespace(status=stroke.Status.CONVERGED, condensed=condensed)

    monkeypatch.setattr(stroke, "_alone", lambda *given: Stroke(40.0, 1.0, "alone"))
    monkeypatch.setattr(stroke, "_meets_itself", lambda *given: False)
    monkeypatch.setattr(stroke, "solve", solved)
    alone = balloon()
    two = {"actuators": alone.actuators * 2, "rows": Rows(alone.rows.effectors, ("left", "right"))}
    found = find_strokes(replace(alone, **two, reach=np.ones((2, 2)), unilateral=np.ones(2, bool)))
    assert [each.reach / 40 for each in found] == pytest.approx([0.6, 0.6], abs=0.15 / 8)


def test_a_failing_solve_ends_the_stroke(found, monkeypatch):
    true = stroke.solve

    def fails(problem, actuation, *rest, **how):
        ended = true(problem, actuation, *rest, **how)
        far = actuation.target[0] > 1.0
        return replace(ended, status=stroke.Status.LIMIT_POINT) if far else ended

    monkeypatch.setattr(stroke, "solve", fails)
    (first,) = find_strokes(bar("tet4", divisions=(12, 2, 2), cables=1))
    assert 0.3 < first.reach < 1.0 and first.why == "beyond it, a limit point"


def test_the_end_of_a_path_is_not_looked_for_in_small_steps(monkeypatch):
    monkeypatch.setattr(stroke, "STRAIN", 1e3)
    monkeypatch.setattr(stroke, "BEND", 1e3)
    monkeypatch.setattr(stroke, "_MOST", {"mm": 0.9})
    solved, true = [], stroke.solve

    def counted(*given, **how):
        solved.append(true(*given, **how))
        return solved[-1]

    monkeypatch.setattr(stroke, "solve", counted)
    (first,) = find_strokes(bar("tet4", divisions=(12, 2, 2), cables=1))
    assert first.why == "beyond it, out of reach" and all(ended.converged for ended in solved[:-1])
    assert not solved[-1].converged and solved[-1].steps <= 30
