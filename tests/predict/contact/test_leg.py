"""A learned leg whose effectors touch, against the energy of hand-made robots and finite elements."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cfem.constraint.contact import ContactPoint
from cfem.core.errors import InputError
from cfem.equilibrium.contact.points import PlacedRobot
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.predict.contact.leg import LearnedLeg, held_by
from cfem.predict.load import load_model
from cfem.predict.loads.wrench_series import Held
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

C = np.diag([2.0, 3.0, 4.0])
K = np.array([[5.0, 1.0], [1.0, 4.0]])
J = np.array([[1.0, 0.5], [0.0, 2.0], [-1.0, 0.3]])
D = np.zeros((3, 3, 3))
D[0, 0, 0], D[1, 1, 1] = -2.0, 1.5
D[0, 1, 2] = D[0, 2, 1] = D[1, 0, 2] = D[1, 2, 0] = D[2, 0, 1] = D[2, 1, 0] = 0.4
BOTH, NEITHER = np.ones(2, bool), np.zeros(2, bool)


def held(a, third=False):
    """Psi = a . K a / 2, e = J a, locked compliance C (1 + a_0 / 10); D is constant."""

    def of(value, first):
        zero = np.zeros_like(value)
        return np.array([value, *first, *[zero] * 4])

    grown = of(C * (1 + a[0] / 10), [C / 10, np.zeros((3, 3))])
    psi = np.array([a @ K @ a / 2, *(K @ a), *K.ravel()])
    return Held(psi, of(J @ a, list(J.T)), grown, of(D, [0 * D, 0 * D]) if third else None, 2)


def leg(unilateral=NEITHER, third=False):
    return LearnedLeg(lambda a: held(a, third), unilateral, np.array([[1.0, 2.0, 3.0]]), np.eye(3), np.zeros(3))


def at(a):
    return SimpleNamespace(target=np.array(a))


def work(a, f):
    """Of the loaded robot with D, whose slopes by a are the forces of its actuators, and by -f the places."""
    u, v = f @ C @ f * (1 + a[0] / 10) / 2, np.einsum("ijk,i,j,k", D, f, f, f) / 6
    return a @ K @ a / 2 - f @ J @ a - u / (1 - v / u)


def slope(function, x, h=1e-6):
    return np.array([(function(x + h * one) - function(x - h * one)) / (2 * h) for one in np.eye(len(x))])


def test_places_and_forces_are_those_of_the_linear_robot():
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    one = LearnedLeg(held, NEITHER, np.array([[1.0, 2.0, 3.0]]), turn, np.array([10.0, 0, 0]))
    np.testing.assert_allclose(one.points, [[8.0, 1.0, 3.0]])
    a, f = np.array([0.3, -0.2]), np.array([0.1, 0.2, -0.4])
    found, yields = one.respond(at(a), J @ a + 1.03 * C @ f, None)
    np.testing.assert_allclose(yields, 1.03 * C, atol=1e-12)
    np.testing.assert_allclose(found.lambda_c, f, atol=1e-12)


@pytest.mark.parametrize("before", [False, True])
def test_with_the_second_order_forces_and_compliance_are_the_slopes_of_the_energy(before):
    a, f = np.array([0.3, 0.2]), np.array([0.1, 0.2, -0.3])
    x = -slope(lambda g: work(a, g), f)
    one = leg(third=True)
    last = one.respond(at(a), x + 0.1, None)[0] if before else None
    found, yields = one.respond(at(a), x, last)
    np.testing.assert_allclose(found.lambda_c, f, atol=1e-8)
    np.testing.assert_allclose(found.delta_c, x, atol=1e-9)
    np.testing.assert_allclose(found.lambda_a, slope(lambda b: work(b, f), a), atol=1e-7)
    step = 1e-5 * np.array([1.0, -2.0, 0.5])
    np.testing.assert_allclose(one.respond(at(a), x + yields @ step, found)[0].lambda_c - f, step, atol=1e-8)


def test_a_cable_that_would_push_goes_slack_and_is_pulled_again():
    one, x = leg(BOTH, third=True), J @ [0.4, 0.1] + [0.1, 0.5, 0.1]
    both = leg(third=True).respond(at([0.4, -0.3]), x, None)[0]
    assert both.lambda_a[1] < 0  # it would push
    found, yields = one.respond(at([0.4, -0.3]), x, None)
    assert found.converged and found.slack.tolist() == [False, True]
    assert found.delta_a[0] == 0.4 and found.delta_a[1] > -0.3
    np.testing.assert_allclose(found.lambda_a[1], 0.0, atol=1e-10)
    assert found.lambda_a[0] >= 0
    np.testing.assert_allclose(slope(lambda b: work(b, found.lambda_c), found.delta_a), found.lambda_a, atol=1e-7)
    np.testing.assert_allclose(-slope(lambda g: work(found.delta_a, g), found.lambda_c), x, atol=1e-8)
    step = 1e-6 * np.array([1.0, -2.0, 0.5])
    moved = one.respond(at([0.4, -0.3]), x + yields @ step, found)[0]
    np.testing.assert_allclose(moved.lambda_c - found.lambda_c, step, atol=1e-9)
    again = one.respond(at([0.4, 1.5]), x, found)[0]
    assert not again.slack.any() and again.lambda_a[1] > 0


def test_only_a_cable_that_cannot_push_goes_slack():
    x = J @ [0.4, 0.1] + [0.1, 0.5, 0.1]
    for which in (0, 1):
        found = leg(np.arange(2) == which, third=True).respond(at([0.4, -0.3]), x, None)[0]
        assert found.converged and found.slack.tolist() == [False, which == 1]
        assert (found.lambda_a[1] < 0) == (which == 0)


def test_a_taut_cable_follows_its_target():
    one, x = leg(BOTH, third=True), J @ [0.4, 1.5]
    before = one.respond(at([0.4, 1.5]), x, None)[0]
    after = one.respond(at([0.5, 1.4]), x, before)[0]
    assert not before.slack.any() and not after.slack.any() and after.delta_a.tolist() == [0.5, 1.4]


def test_a_slack_cable_stays_slack_while_its_target_is_longer():
    one, x = leg(BOTH, third=True), J @ [0.4, 0.1] + [0.1, 0.5, 0.1]
    found = one.respond(at([0.4, -0.3]), x, None)[0]
    for target in (-0.5, -0.3, found.delta_a[1] - 1e-3):
        again = one.respond(at([0.4, target]), x, found)[0]
        assert again.slack.tolist() == [False, True]
        np.testing.assert_allclose(again.delta_a, found.delta_a, atol=1e-9)
    taut = one.respond(at([0.4, found.delta_a[1] + 1e-3]), x, found)[0]
    assert not taut.slack.any() and taut.lambda_a[1] > 0


@pytest.mark.parametrize("far", [5.0, -5.0])
def test_places_beyond_what_the_series_knows_are_reached_with_forces_that_are_finite(far):
    """x_0 of the approximant alone ends at 3 one way, and has a pole the other."""
    x = np.array([far, 0.0, 0.0])
    found, yields = leg(third=True).respond(at([0.0, 0.0]), x, None)
    np.testing.assert_allclose(found.delta_c, x, atol=1e-9)
    assert np.abs(found.lambda_c).max() < 20  # N; 2.5 by the linear law
    assert np.linalg.eigvalsh(yields)[0] > 0


def test_a_load_behind_the_points_moves_them_and_the_actuators_carry_it():
    """Six rows, of a point and of a centre of mass: the linear law of all of them."""
    a, load, more = np.array([0.4, -0.3]), np.array([0.1, -0.2, 0.3]), np.vstack([J, J[::-1] / 2])
    whole = np.kron([[1.0, 0.5], [0.5, 1.0]], C)
    psi = np.array([a @ K @ a / 2, *(K @ a), *K.ravel()])
    e, C6 = np.array([more @ a, *more.T, *np.zeros((4, 6))]), np.array([whole, *np.zeros((6, 6, 6))])
    one = replace(leg(), held=lambda _: Held(psi, e, C6, None, 2), load=load)
    x = J @ a + np.array([0.2, 0.1, -0.1])
    found, yields = one.respond(at(a), x, None)
    wrench = np.concatenate([found.lambda_c, load])
    np.testing.assert_allclose(more @ a + whole @ wrench, np.concatenate([x, found.delta_e]), atol=1e-12)
    np.testing.assert_allclose(found.lambda_a, K @ a - more.T @ wrench, atol=1e-12)
    np.testing.assert_allclose(yields, C, atol=1e-12)


def test_a_model_without_the_series_is_refused():
    with pytest.raises(InputError, match="a leg needs a model of kind spectral and form displacement"):
        held_by(SimpleNamespace(form="force"))


def test_finite_elements_let_the_cable_slack_and_agree_to_the_first_order_of_the_force(bar):
    """The bar's model was sampled without `loads`: half the force leaves a quarter of the error."""
    robot = build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))
    points = tuple(ContactPoint(one.attachment) for one in robot.effectors)
    touching = replace(robot, contacts=points, rows=replace(robot.rows, contacts=robot.rows.effectors))
    whole, still = np.eye(3), np.zeros(3)
    fe = PlacedRobot(Problem(touching), whole, still)
    held_there, off = held_by(load_model(bar / "models" / "bar" / "spectral")), []
    learned = LearnedLeg(held_there, robot.unilateral, robot.rest_e.reshape(-1, 3), whole, still)
    a = displacement(np.array([1.5]))
    for force in (4e-3, 2e-3):
        x = held_there(a.target).under(force * np.array([0.0, 1.0, -1.0])).e
        truth, _ = fe.respond(a, x, None)
        found, _ = learned.respond(a, x, None)
        off.append(np.abs(found.lambda_c - truth.lambda_c).max())
        assert not (found.slack.any() or truth.slack.any())
    assert 3.5 < off[0] / off[1] < 4.5
    there, slack = held_there(np.array([0.1])).e[0], displacement(np.array([0.05]))
    truth, softer = fe.respond(slack, there, None)
    found, yields = learned.respond(slack, there, None)
    assert found.slack.all() and truth.slack.all()
    np.testing.assert_allclose(found.delta_a, truth.delta_a, atol=1e-3)
    np.testing.assert_allclose(yields, softer, atol=0.1 * np.abs(softer).max())


def test_a_cable_that_carries_nothing_because_nothing_pulls_is_not_slack():
    found, _ = leg(BOTH).respond(at([0.0, 0.0]), np.zeros(3), None)
    assert found.converged and not found.slack.any() and not found.lambda_a.any()
