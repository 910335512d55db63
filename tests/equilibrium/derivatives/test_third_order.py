"""dW/dlambda is the derivative of whole solves, and the third derivative of one energy: totally symmetric."""

from dataclasses import replace

import numpy as np
import pytest
from fe_motion.moving import moving_bar, moving_rod
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.condensed.skin import Skin
from cfem.condensed.viscosity import Viscosity
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.surface import outer_surface
from cfem.equilibrium.derivatives.third_order import skin_load_derivatives
from cfem.equilibrium.motion.inertia import mass_of
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.skinned import skinned
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.plant.fem_plant import pushed

EXACT = NewtonSettings(tolerance=1e-12)
ROBOTS = {
    "tet4, corotational": dict(element="tet4", law="corotational", poisson=0.3),
    "tet10p0, nu 0.49": dict(poisson=0.49),
    "hex8, ogden": dict(element="hex8", law="ogden", poisson=0.4),
    "rigid end": dict(rigid_end=True),
    "weight, contact free": dict(weight=0.01, contact=True),
}


@pytest.fixture(scope="module", params=fast_are({"hex8, ogden", "rigid end", "weight, contact free"}, ROBOTS))
def solved(request):
    problem = Problem(bar(divisions=(5, 1, 1), **ROBOTS[request.param]))
    state = solve(problem, actuation.displacement([2.0, 3.5]), settings=EXACT, wanted=Wanted(third_order=True))
    assert state.converged
    return problem, state


def test_it_is_the_derivative_of_W_along_whole_solves(solved):
    """Richardson's rule on whole solves: errors of the fourth power of the step."""
    problem, state = solved
    lam = state.state.lam
    for k in range(problem.robot.rows.n_a):

        def slope(h, k=k):
            ahead, behind = (
                solve(problem, actuation.force(lam + sign * h * np.eye(len(lam))[k]), state.state, None, EXACT)
                for sign in (1, -1)
            )
            assert ahead.converged and behind.converged
            return (ahead.condensed.W - behind.condensed.W) / (2 * h)

        h = 2e-2 * np.abs(lam).max()  # rounding outweighs what is left of the series below
        expected = (4 * slope(h / 2) - slope(h)) / 3
        np.testing.assert_allclose(state.dW[k], expected, rtol=0, atol=5e-7 * np.abs(expected).max())


def test_it_is_the_third_derivative_of_one_energy_and_the_second_of_the_effectors(solved):
    problem, state = solved
    rows = problem.robot.rows
    third = state.dW[:, rows.active, rows.active]
    for order in ((0, 2, 1), (1, 0, 2), (2, 1, 0)):
        np.testing.assert_allclose(third.transpose(order), third, rtol=0, atol=1e-6 * np.abs(third).max())
    second = state.dW[:, rows.e, rows.active]  # [k, i, j] = d2 e_i / dlambda_j dlambda_k
    np.testing.assert_allclose(second.transpose(2, 1, 0), second, rtol=0, atol=1e-6 * np.abs(second).max())


def with_skin(robot):
    """Three modes that are no motions of it: random fields over its surface."""
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    modes = np.random.default_rng(0).normal(size=(3, *surface.rest.shape))
    skin = Skin(surface.nodes, surface.rest, surface.triangles, surface.weights, modes, np.zeros((1, 2)))
    return skinned(robot, skin)


@pytest.mark.parametrize("name", ["solid", "rigid end", "rod"])
def test_so_it_is_of_the_rows_of_a_skin_and_of_mass(name):
    """W and V of all rows, against whole solves."""
    robot = (
        moving_rod(6, [Viscosity(2e-3)], ((0.3, 0.5), (-0.5, 0.1)))
        if name == "rod"
        else moving_bar([Viscosity(2e-3)], element="tet10p0", divisions=(4, 1, 1), rigid_end=name == "rigid end")
    ).robot
    problem = Problem(with_skin(robot))
    lam, mass = np.array([0.02, 0.01] if name == "rod" else [0.5, 0.2])[: robot.rows.n_a], mass_of(robot)
    options = {"settings": EXACT, "wanted": Wanted(mass=mass, third_order=True)}
    state = solve(problem, actuation.force(lam), **options)
    assert state.converged and len(state.condensed.rows.skin) == 3
    for k in range(len(lam)):

        def slope(h, k=k):
            step = h * np.eye(len(lam))[k]
            ahead, behind = (solve(problem, actuation.force(lam + side * step), **options) for side in (1, -1))
            both = zip((ahead.condensed.W, ahead.inertia.V), (behind.condensed.W, behind.inertia.V), strict=True)
            return [(one - other) / (2 * h) for one, other in both]

        h = 2e-2 * np.abs(lam).max()  # rounding outweighs what is left of the series below
        for found, coarse, fine in zip((state.dW[k], state.inertia.dV[k]), slope(h), slope(h / 2), strict=True):
            expected = (4 * fine - coarse) / 3
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-5 * np.abs(expected).max())


def test_it_costs_no_factorisation_and_changes_nothing_else():
    problem = Problem(bar(divisions=(5, 1, 1)))
    plain, more = (
        solve(problem, actuation.displacement([2.0, 3.5]), wanted=Wanted(third_order=wanted))
        for wanted in (False, True)
    )
    assert plain.dW is None and more.dW.shape == (2, 5, 5)
    assert (more.factorizations, more.iterations) == (plain.factorizations, plain.iterations)
    np.testing.assert_array_equal(more.condensed.W, plain.condensed.W)


def test_stiffness_scales_it_by_its_inverse_square():
    """No outside formula, but one of units: W ~ 1/E and lambda ~ E at the same delta."""
    soft, stiff = (
        solve(
            Problem(bar(young=young, divisions=(4, 1, 1))),
            actuation.displacement([2.0, 3.0]),
            wanted=Wanted(third_order=True),
        )
        for young in (1.0, 100.0)
    )
    np.testing.assert_allclose(1e4 * stiff.dW, soft.dW, rtol=0, atol=1e-6 * np.abs(soft.dW).max())


def test_a_cable_that_moves_nothing_changes_nothing():
    """One along held nodes only: its row of W is zero, and what it changes is zero, not 0/0."""
    robot = bar(divisions=(4, 1, 1))
    held = np.flatnonzero(robot.body.mesh.X[:, 0] < 31)
    mesh = robot.body.mesh
    points = [attach(mesh, np.array([x, 5.0, 5.0]), 0.0, "idle") for x in (2.0, 10.0)]
    idle = make_cable(points, None, "idle")
    assert np.isin(idle.nodes, held).all()
    problem = Problem(replace(robot, fixed=held, actuators=(robot.actuators[0], idle)))
    state = solve(problem, actuation.force([0.5, 0.2]), wanted=Wanted(third_order=True))
    assert state.converged and not state.dW[1].any() and state.dW[0].any()


def test_how_locked_compliance_changes_with_loads_is_that_of_loaded_solves(solved):
    problem, state = solved
    found = solve(
        problem,
        actuation.displacement(state.delta_a),
        settings=EXACT,
        slack=False,
        wanted=Wanted(third_order=True, loads=True),
    )
    D, e, a = found.dC, problem.robot.rows.e, problem.robot.rows.a
    assert D.shape == (3, 3, 3)

    def locked(push):
        loaded = Problem(pushed(problem.robot, push))
        at = solve(loaded, actuation.displacement(state.delta_a), settings=EXACT, slack=False)
        assert at.converged
        W = at.condensed.W
        return W[e, e] - W[e, a] @ np.linalg.solve(W[a, a], W[a, e])

    h = 1e-4 / np.abs(np.linalg.eigvalsh(locked(np.zeros(3)))).max()
    for k in range(3):
        step = h * np.eye(3)[k]
        expected = (locked(step) - locked(-step)) / (2 * h)
        np.testing.assert_allclose(D[k], expected, rtol=0, atol=1e-5 * np.abs(D).max())


def test_loads_on_a_skin_change_compliance_as_loaded_solves_say(solved):
    """The third derivative of one energy: by two rows of the skin and an effector, which is pushed here."""
    problem, state = solved
    robot = with_skin(problem.robot)
    rows, wanted = robot.rows, actuation.displacement(state.delta_a)
    at = solve(
        Problem(replace(robot, contacts=(), rows=replace(rows, contacts=()))),
        wanted,
        slack=False,
        wanted=Wanted(keep=True),
    )
    D = skin_load_derivatives(at.linear)
    assert D.shape == (3, 6, 6)
    within = D[:, 3:, 3:]
    np.testing.assert_allclose(within.transpose(1, 0, 2), within, rtol=0, atol=1e-6 * np.abs(within).max())

    def locked(push):
        loaded = Problem(pushed(robot, push))
        W = solve(loaded, wanted, settings=EXACT, slack=False).condensed.W
        s, a = rows.s, rows.a
        return W[s, s] - W[s, a] @ np.linalg.solve(W[a, a], W[a, s])

    h = 1e-4 / np.abs(np.linalg.eigvalsh(locked(np.zeros(3)))).max()
    for e in range(3):
        step = h * np.eye(3)[e]
        expected = (locked(step) - locked(-step)) / (2 * h)
        np.testing.assert_allclose(D[:, e, 3:], expected, rtol=0, atol=2e-5 * np.abs(D).max())
