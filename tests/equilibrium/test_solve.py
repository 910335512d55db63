"""Robustness, honesty and cost of the solver."""

from dataclasses import replace
from itertools import cycle, product

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from support.blocks import bar, box_body
from support.fast_cases import fast_are

from cfem.condensed import Rows
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.contact import make_contact
from cfem.constraint.effector import make_effector
from cfem.equilibrium.newton import NewtonSettings, judged, linear_motion, newton
from cfem.equilibrium.solve import Wanted, rest_state, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.equilibrium.system.solution import State, Status
from cfem.mechanics.assembly import symmetric_product
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS


@pytest.fixture(scope="module")
def problem():
    return Problem(bar(divisions=(6, 1, 1)))


@pytest.mark.parametrize("law, element", fast_are(zip(LAWS, cycle(ELEMENTS)), product(LAWS, ELEMENTS)))
def test_large_bending_converges_for_every_element_and_law(law, element):
    state = solve(Problem(bar(element, law, poisson=0.45, divisions=(6, 1, 1))), actuation.displacement([7.0, 5.0]))
    assert state.converged and state.residual < 1e-8
    np.testing.assert_allclose(state.delta_a, [7.0, 5.0], atol=1e-9)


def test_factorizations_do_not_grow_as_the_material_becomes_incompressible():
    counts = [
        solve(Problem(bar(poisson=poisson, divisions=(6, 1, 1))), actuation.displacement([6.0, 3.0])).factorizations
        for poisson in (0.3, 0.49, 0.4999)
    ]
    assert max(counts) <= min(counts) + 6, counts


def test_W_does_not_lock_as_the_material_becomes_incompressible():
    tip = {
        element: [
            solve(
                Problem(bar(element, poisson=poisson, divisions=(6, 1, 1))), actuation.force(np.zeros(2))
            ).condensed.W[1, 1]
            for poisson in (0.45, 0.4999)
        ]
        for element in ("tet4", "tet10p0")
    }
    assert tip["tet10p0"][1] > 0.85 * tip["tet10p0"][0]
    assert tip["tet4"][1] < 0.4 * tip["tet4"][0]


@pytest.mark.parametrize(
    "how",
    [actuation.displacement([4.0, 3.0]), actuation.force([1.5, 1.0]), actuation.pull([0.5, 0.3], [8.0, 8.0])],
)
def test_every_kind_of_actuation_is_met(problem, how):
    state = solve(problem, how)
    assert state.converged
    np.testing.assert_allclose(how.C @ state.delta_a, how.target, atol=1e-9)
    mu = np.linalg.lstsq(how.C.T, state.lambda_a - how.offset, rcond=None)[0]
    np.testing.assert_allclose(how.offset + how.C.T @ mu, state.lambda_a, atol=1e-12)


def test_pull_in_proportion_covers_the_pulling_states(problem):
    reach = np.array([8.0, 8.0])
    single = solve(problem, actuation.pull([1.0, 0.0], reach))
    assert single.delta_a[0] == pytest.approx(8.0) and single.lambda_a[1] == 0.0 and single.slack[1]
    both = solve(problem, actuation.pull([0.6, 0.6], reach))
    assert both.lambda_a[0] == pytest.approx(both.lambda_a[1])


def test_a_tension_that_rounding_makes_is_none(problem):
    for let_out in (1e-6, 1e-4, 1e-2):  # so little that the solve begins with both cables held
        state = solve(problem, actuation.displacement([0.0, -let_out]))
        assert state.converged and state.slack.all() and np.abs(state.lambda_a).max() < 1e-12
    pulled = solve(problem, actuation.displacement([1e-6, -1e-6]))  # a tension of its own, however small
    assert pulled.slack.tolist() == [False, True]


def test_a_cable_that_would_push_goes_slack(problem):
    state = solve(problem, actuation.displacement([7.0, -8.0]))
    assert state.converged and state.slack.tolist() == [False, True]
    assert state.lambda_a[1] == 0.0 and state.delta_a[1] > -8.0
    bilateral = solve(problem, actuation.displacement([7.0, -8.0]), slack=False)
    assert bilateral.lambda_a[1] < 0.0 and not bilateral.slack.any()


def test_a_cable_that_pushes_on_the_way_is_let_go_there():
    three = bar("tet4", divisions=(6, 1, 1), cables=3)
    ends = {name: getattr(three, name)[::2] for name in ("actuators", "reach", "unilateral")}
    robot = replace(three, rows=Rows(three.rows.effectors, ("lower", "upper")), **ends)
    # The lower cable is slack there; held at 0 mm it would push, and the path would end at 15.8 mm.
    problem, how = Problem(robot), actuation.displacement([0.0, 20.0])
    found, pushing = solve(problem, how), solve(problem, how, slack=False)
    assert found.converged and found.slack.tolist() == [True, False]
    assert found.delta_a[0] > 0.0 and found.delta_a[1] == pytest.approx(20.0)
    assert not pushing.converged and pushing.factorizations > found.factorizations  # to the end of that path alone


def test_a_path_that_ends_where_no_set_of_cables_can_hold_is_unstable():
    """Its last state has buckled, and still no cable pushes there."""
    problem = Problem(bar(divisions=(6, 1, 1), cables=3))
    found = solve(problem, actuation.displacement([17.64, 20.32, 0.0]))
    assert found.status is Status.UNSTABLE and found.condensed is None
    assert found.lambda_a.min() >= 0.0 and found.path < 1.0
    lower, _ = problem.stiffness(problem.evaluate(found.state.x, np.empty(0)), found.state.lam)
    A = symmetric_product(problem.pattern, lower, np.eye(problem.pattern.n_dof))
    assert np.linalg.eigvalsh(A).min() < 0.0


def test_the_motion_that_is_predicted_is_that_of_a_small_load(problem):
    motion, tangent = linear_motion(problem, rest_state(problem), actuation.displacement([4.0, 3.0]), SolveCost())
    tiny = solve(problem, actuation.displacement([4e-5, 3e-5]))
    moved = np.linalg.norm(tiny.state.x - problem.rest, axis=1).max()
    assert motion == pytest.approx(1e5 * moved / problem.robot.body.mesh.size, rel=1e-4)
    assert tangent.factor.negative == 0


def test_the_whole_way_is_the_first_step_where_the_predicted_motion_is_small(problem):
    small, large = actuation.displacement([0.4, 0.3]), actuation.displacement([4.0, 3.0])
    assert solve(problem, small).steps == 1 and solve(problem, large).steps == 2
    careful = replace(NewtonSettings(), small_motion=0.0)
    np.testing.assert_allclose(
        solve(problem, small, settings=careful).state.x, solve(problem, small).state.x, atol=1e-9
    )
    assert solve(problem, small, settings=careful).factorizations > solve(problem, small).factorizations


def test_warm_start_next_door_costs_one_factorization(problem):
    here = solve(problem, actuation.displacement([4.0, 3.0]))
    near = here.state.x + here.response @ np.linalg.solve(here.condensed.W_aa, [0.05, 0.05])
    start = State(near, np.empty(0), here.lambda_a)
    assert solve(problem, actuation.displacement([4.05, 3.05]), start).factorizations == 1


def test_held_nodes_are_held_whatever_the_start(problem):
    here = solve(problem, actuation.displacement([4.0, 3.0]))
    moved = State(here.state.x + 0.01, np.empty(0), here.lambda_a)
    again = solve(problem, actuation.displacement([4.0, 3.0]), moved)
    assert again.converged
    np.testing.assert_array_equal(again.state.x[problem.robot.fixed], problem.rest[problem.robot.fixed])
    np.testing.assert_allclose(again.delta_e, here.delta_e, atol=1e-9)


def test_failure_is_a_status_and_never_a_nan(problem):
    beyond = solve(problem, actuation.displacement([59.0, 59.0]))
    assert not beyond.converged and beyond.condensed is None
    assert np.isfinite(beyond.state.x).all()
    assert solve(problem, actuation.displacement([np.nan, 0.0])).status is Status.NOT_FINITE


def test_a_body_that_nothing_holds_is_singular():
    robot = bar(divisions=(3, 1, 1))
    free = Robot(**{**robot.__dict__, "fixed": np.array([], dtype=int)})
    assert solve(Problem(free), actuation.force(np.zeros(2))).status is Status.SINGULAR


def test_bar_without_an_axis_of_contacts_pays_for_its_own_rows_only(problem):
    state = solve(problem, actuation.force(np.zeros(2)))
    assert state.condensed.W.shape == (5, 5)
    assert problem.robot.rows.n_c == 0


def elastica_tip(load: float) -> np.ndarray:
    """Tip (x, y) / L of a cantilever under a dead end load of P L^2 / (E I) = load, across its axis at rest."""
    answer = solve_bvp(
        lambda s, y: np.stack([y[1], -load * np.cos(y[0]), np.cos(y[0]), np.sin(y[0])]),
        lambda a, b: np.array([a[0], b[1], a[2], a[3]]),
        np.linspace(0, 1, 50),
        np.zeros((4, 50)),
        tol=1e-10,
    )
    return answer.y[2:, -1]


def cantilever_tip(divisions: int, load: float) -> np.ndarray:
    """The same by finite elements, loaded by a cable so long that its direction does not turn."""
    length, side, young = 100.0, 2.0, 1000.0
    body = box_body((length, side, side), (divisions, 1, 1), young=young, poisson=0.0)
    end = attach(body.mesh, np.array([length, side / 2, side / 2]), 1.5, "end")
    robot = Robot(
        name="cantilever",
        body=body,
        fixed=np.flatnonzero(body.mesh.X[:, 0] < 1e-9),
        actuators=(make_cable([end], np.array([length, 1e7, side / 2]), "load"),),
        effectors=(make_effector(body.mesh, end.point, 1.5, 5.0, "tip"),),
        rows=Rows(("x", "y", "z"), ("load",)),
        reach=np.array([[0.0, 100.0]]),
        unilateral=np.array([True]),
        length=length,
    )
    force = load * young * side**4 / 12 / length**2
    state = solve(Problem(robot), actuation.force([force]), settings=NewtonSettings(tolerance=1e-8))
    assert state.converged, state.status.value
    return (state.delta_e[:2] + np.array([length, 0.0])) / length


def test_slender_cantilever_against_the_elastica():
    load = 3.0
    coarse, fine = cantilever_tip(16, load), cantilever_tip(32, load)
    expected = elastica_tip(load)
    extrapolated = fine + (fine - coarse) / 3  # second order in the element length
    assert expected[1] > 0.55
    np.testing.assert_allclose(extrapolated, expected, atol=0.01 * expected[1])
    assert np.abs(fine - expected).max() < np.abs(coarse - expected).max()


def test_the_tolerance_that_rounding_allows_is_part_of_the_answer():
    soft, stiff = (
        solve(Problem(bar(poisson=poisson, divisions=(3, 1, 1))), actuation.displacement([2.0, 1.0]))
        for poisson in (0.45, 0.49999999)
    )
    assert soft.converged and soft.tolerance == 1e-10
    # The bulk modulus of the second is 1e7 of its shear modulus: the residual of its positions is no finer.
    assert stiff.converged and stiff.residual <= 1.5 * stiff.tolerance
    assert stiff.tolerance == stiff.rounding > 1e-8


def test_a_residual_above_what_the_answer_allows_is_not_converged(monkeypatch):
    problem, true = Problem(bar(divisions=(3, 1, 1))), Problem.relative_residual

    def settled(self, at, lam, tangent=None):
        return true(self, at, lam, tangent) if tangent else 1e-8

    monkeypatch.setattr(Problem, "relative_residual", settled)
    found = solve(problem, actuation.displacement([2.0, 1.0]))
    assert found.status is Status.INACCURATE and found.condensed is None


def column(divisions: int) -> tuple[Robot, float]:
    """A slender column with a cable along its axis to its foot, its end a contact point, and Euler's load."""
    length, side, young = 100.0, 4.0, 1.0
    body = box_body((length, side, side), (divisions, 1, 1), young=young, poisson=0.0)
    middle = side / 2
    end = attach(body.mesh, np.array([length - 1.0, middle, middle]), 1.5, "end")
    robot = Robot(
        name="column",
        body=body,
        fixed=np.flatnonzero(body.mesh.X[:, 0] < 1e-9),
        actuators=(make_cable([end], np.array([0.0, middle, middle]), "axis"),),
        effectors=(make_effector(body.mesh, end.point, 1.5, 5.0, "tip"),),
        rows=Rows(("x", "y", "z"), ("axis",), ("end.x", "end.y", "end.z")),
        reach=np.array([[0.0, 10.0]]),
        unilateral=np.array([True]),
        length=length,
        contacts=(make_contact(body.mesh, end.point, 1.5, "end"),),
    )
    return robot, np.pi**2 * young * side**4 / 12 / length**2


def test_a_column_that_is_held_sideways_is_stable_beyond_its_buckling_load():
    """Its end guided, it buckles at 2.05 times that load (Timoshenko and Gere, section 2.4): the two negative
    eigenvalues of its stiffness belong to what the actuation holds."""
    robot, euler = column(8)
    problem = Problem(robot)
    guided = actuation.Actuation(np.eye(4)[2:], np.zeros(2), np.array([1.4 * euler, 0.0, 0.0, 0.0]))
    found = newton(problem, rest_state(problem), guided, NewtonSettings(), SolveCost())
    assert found.status is Status.CONVERGED
    assert problem.factor(found.at, found.lam, SolveCost()).factor.negative == 2
    assert judged(problem, found, guided, SolveCost()).beyond == 0
    solved = solve(problem, guided)
    assert solved.converged and solved.path == 1.0


def test_a_column_beyond_its_buckling_load_is_never_called_stable_while_straight():
    """A cable along the axis of a slender column, to its foot: Euler's load is pi^2 E I / L^2 for a force that always
    points to the foot (Timoshenko and Gere, Theory of Elastic Stability, 2nd ed., section 2.8)."""
    robot, euler = column(16)
    problem = Problem(robot)
    below, above = (solve(problem, actuation.force([factor * euler])) for factor in (0.9, 1.2))
    assert below.converged and np.abs(below.delta_e[1:]).max() < 1.0
    bent = np.abs(above.delta_e[1:]).max() > 5.0
    assert above.status in (Status.UNSTABLE, Status.BIFURCATION) or (above.converged and bent)
    assert solve(problem, actuation.force([1.2 * euler]), wanted=Wanted(condense=False)).status is above.status


def test_a_start_that_knows_the_actuators_alone_leaves_contacts_free():
    """Such as one that is predicted from samples in which nothing holds the contact points."""
    problem = Problem(bar(element="tet4", divisions=(4, 1, 1), cables=2, contact=True))
    near, there = (actuation.displacement([pulled, 0.0]) for pulled in (0.5, 0.6))
    state = solve(problem, near).state
    solved = solve(problem, there, start=replace(state, lam=state.lam[:2]))
    assert solved.converged and solved.steps == 1
    np.testing.assert_allclose(solved.state.x, solve(problem, there).state.x, atol=1e-8)
