"""The identities that hold to round-off with the consistent tangent: each is judged by whole equilibrium solves."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.body import make_body
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material

EXACT = NewtonSettings(tolerance=1e-12)


ROBOTS = {
    "tet4, corotational": dict(element="tet4", law="corotational", poisson=0.3),
    "tet10p0, nu 0.49": dict(element="tet10p0", poisson=0.49),
    "hex8, ogden": dict(element="hex8", law="ogden", poisson=0.4),
    "rigid end": dict(rigid_end=True),
    "weight, contact free": dict(weight=0.01, contact=True),
}
FEW = {"tet10p0, nu 0.49", "hex8, ogden", "weight, contact free"}


@pytest.fixture(scope="module", params=fast_are(FEW, ROBOTS))
def problem(request):
    return Problem(bar(divisions=(5, 1, 2), **ROBOTS[request.param]))


def solved(problem, how, **options):
    state = solve(problem, how, settings=EXACT, **options)
    assert state.converged, state.status.value
    return state


def test_W_is_the_derivative_of_delta_by_lambda(problem):
    base = solved(problem, actuation.displacement([3.0, 2.5]))
    rows, h, measured = problem.robot.rows, 1e-3, []
    for j in range(rows.n_a):
        step = h * np.eye(rows.n_a)[j] * np.abs(base.lambda_a).max()
        up, down = (
            solve(problem, actuation.force(base.lambda_a + sign * step), base.state, settings=EXACT) for sign in (1, -1)
        )
        slope = (np.concatenate([up.delta_e, up.delta]) - np.concatenate([down.delta_e, down.delta])) / (2 * step[j])
        column = base.condensed.W[:, rows.n_e + j]
        np.testing.assert_allclose(column, slope, rtol=0, atol=1e-6 * np.abs(column).max())
        measured.append(slope[rows.a])
    # reciprocity (Betti) of what the solves say, which nobody has symmetrised
    np.testing.assert_allclose(measured, np.transpose(measured), rtol=1e-6)


def test_energy_has_gradient_lambda_and_hessian_W_inverse(problem):
    at = np.array([3.0, 2.5])
    base = solved(problem, actuation.displacement(at))
    h = 1e-3
    for j in range(2):
        up, down = (
            solve(problem, actuation.displacement(at + s * h * np.eye(2)[j]), base.state, settings=EXACT)
            for s in (1, -1)
        )
        force = (up.energy - down.energy) / (2 * h)
        assert force == pytest.approx(base.lambda_a[j], rel=1e-6)
        stiffness = (up.lambda_a - down.lambda_a) / (2 * h)
        np.testing.assert_allclose(stiffness, np.linalg.inv(base.condensed.W_aa)[:, j], rtol=1e-5)
        moved = (up.delta_e - down.delta_e) / (2 * h)
        expected = np.linalg.solve(base.condensed.W_aa, base.condensed.W_ea.T).T[:, j]  # at constant contact forces
        np.testing.assert_allclose(expected, moved, rtol=0, atol=1e-6 * np.abs(moved).max())


def test_W_is_positive_definite_and_delta_is_consistent(problem):
    state = solved(problem, actuation.displacement([5.0, 4.0]))
    W = state.condensed.W
    assert np.linalg.eigvalsh(W).min() > 0
    np.testing.assert_allclose(state.condensed.delta_a, state.delta_a, atol=1e-12)
    np.testing.assert_allclose(state.condensed.delta_e, state.delta_e, atol=1e-12)


def test_W_from_a_nearby_factor_equals_W_from_a_fresh_one(problem):
    """The variational W of a chord solve, against a solve that starts (and so factors) at the answer."""
    first = solved(problem, actuation.displacement([3.0, 2.5]))
    again = solve(problem, actuation.displacement([3.0, 2.5]), first.state, settings=EXACT)
    assert again.factorizations == 1 and again.iterations <= 1
    np.testing.assert_allclose(
        first.condensed.W, again.condensed.W, rtol=0, atol=1e-11 * np.abs(again.condensed.W).max()
    )


def test_young_modulus_scales_out():
    soft, stiff = (Problem(bar(young=young, divisions=(4, 1, 1))) for young in (1.0, 1000.0))
    a, b = (solved(problem, actuation.displacement([3.0, 3.0])) for problem in (soft, stiff))
    np.testing.assert_allclose(b.condensed.W * 1000, a.condensed.W, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(b.lambda_a / 1000, a.lambda_a, rtol=1e-9)
    np.testing.assert_allclose(b.condensed.delta_free, a.condensed.delta_free, atol=1e-8)


def test_contacts_are_active_rows_like_any_other():
    """Displacements of cables and contact prescribed together: W, energy and forces agree with whole solves."""
    problem = Problem(bar(divisions=(4, 1, 1), contact=True, weight=0.01))
    at = np.array([3.0, 2.0, -0.5, 1.0, 0.5])
    base, h = solved(problem, actuation.displacement(at)), 1e-3
    np.testing.assert_allclose(np.concatenate([base.delta_a, base.delta_c]), at, atol=1e-9)
    for j in (1, 2, 4):
        up, down = (
            solve(problem, actuation.displacement(at + s * h * np.eye(5)[j]), base.state, settings=EXACT)
            for s in (1, -1)
        )
        assert (up.energy - down.energy) / (2 * h) == pytest.approx(base.state.lam[j], rel=1e-5)
        act = problem.robot.rows.active
        stiffness = (up.state.lam - down.state.lam) / (2 * h)
        expected = np.linalg.inv(base.condensed.W[act, act])[:, j]
        np.testing.assert_allclose(stiffness, expected, rtol=0, atol=1e-6 * np.abs(expected).max())
        moved = (up.delta_e - down.delta_e) / (2 * h)
        np.testing.assert_allclose(base.condensed.effector_jacobian[:, j], moved, rtol=0, atol=1e-6)


def test_a_rigid_part_is_the_limit_of_a_stiff_one():
    """W with a rigid end, against the same end 10^5 times stiffer (which rounding still lets converge)."""
    rigid = Problem(bar(divisions=(4, 1, 1), rigid_end=True, poisson=0.3))
    robot = bar(divisions=(4, 1, 1), poisson=0.3)
    end = np.flatnonzero((robot.body.mesh.X[robot.body.mesh.cells, 0] > 44.9).all(axis=1))
    soft, hard = Material(LAWS["neo-hookean"], 1.0, 0.3), Material(LAWS["neo-hookean"], 1e5, 0.3)
    stiff = Problem(replace(robot, body=make_body(robot.body.mesh, robot.body.element, soft, [(end, hard)])))
    a, b = (solve(problem, actuation.displacement([4.0, 3.0])) for problem in (rigid, stiff))
    assert a.converged and b.converged, (a.status, b.status)
    assert b.factorizations <= 15  # with stresses of its own at every tangent: more than a thousand
    np.testing.assert_allclose(a.condensed.W, b.condensed.W, rtol=0, atol=1e-4 * np.abs(b.condensed.W).max())
    np.testing.assert_allclose(a.delta_e, b.delta_e, atol=1e-3)


def test_rest_is_an_equilibrium_without_force(problem):
    if problem.robot.loads is not None:
        sagging = solved(problem, actuation.force(np.zeros(2)))
        # work of a slowly growing linear load is half of load times displacement: psi = -1/2 f u to first order
        assert sagging.delta_e[2] < 0 and sagging.energy < 0
        return
    rest = solved(problem, actuation.force(np.zeros(2)))
    assert rest.energy == 0.0
    assert np.abs(rest.delta_e).max() < 1e-12
    assert rest.iterations == 0
