"""Rods of rigid sections: closed forms of large bending, order of convergence, identities of the condensed model."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.rods import LENGTH, MATERIAL, SHAPE, elastica, rod_body, rod_problem

from cfem.constraint.cable import make_cable
from cfem.constraint.contact import ContactPoint
from cfem.constraint.rod_chambers import make_rod_chambers
from cfem.constraint.section_point import attach_to_sections
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation, displacement, force
from cfem.equilibrium.system.solution import Status
from cfem.mechanics.assembly import symmetric_product
from cfem.mechanics.body import response

EA, _, _, GJ, EI, _ = SHAPE.stiffness(MATERIAL.young, MATERIAL.poisson)


def chambers(*centres):
    """One along the whole rod at each (y, z), of 0.5 mm^2."""
    return lambda body: [make_rod_chambers(body.rod, [c], 0.5, np.arange(len(body.rod.length))) for c in centres]


@pytest.mark.parametrize("elements", [1, 8])
def test_pressure_off_the_axis_bends_to_an_exact_circle(elements):
    """A moment p A z and a force p A at the end: constant curvature, whatever the number of elements."""
    problem = rod_problem(elements, chambers((0.0, 2.0)))
    for pressure in (0.01, 2 * np.pi * EI / (LENGTH * 0.5 * 2.0) / (2 if elements == 1 else 1) * 0.99):
        solved = solve(problem, force([pressure]))
        assert solved.converged
        stretched = 1 + pressure * 0.5 / EA
        angle = pressure * 0.5 * 2.0 * LENGTH / EI
        radius = stretched * LENGTH / angle
        tip = np.array([radius * np.sin(angle), 0.0, -radius * (1 - np.cos(angle))])
        np.testing.assert_allclose(solved.delta_e + [LENGTH, 0, 0], tip, atol=1e-9 * LENGTH)
        np.testing.assert_allclose(solved.delta, [0.5 * LENGTH * (stretched - 1) + 0.5 * 2.0 * angle], rtol=1e-9)


def tip_force(components):
    def loads(body):
        forces = np.zeros_like(body.mesh.X)
        forces[body.sections.nodes[-1]] = np.asarray(components) / 4
        return forces

    return loads


def test_a_dead_force_bends_it_to_the_elastica_at_second_order():
    """Slender enough (L^2 A / I = 3e4) that stretch and shear do 1e-4 of what bending does; theirs is taken off by
    extrapolation."""
    F = 4 * EI / LENGTH**2
    tips = []
    for elements in (8, 16, 32):
        solved = solve(rod_problem(elements, chambers((0.0, 0.0)), tip_force([0.0, F, 0.0])), force([0.0]))
        assert solved.converged
        tips.append(solved.delta_e[:2] + [LENGTH, 0.0])
    coarse, middle, fine = tips
    assert np.linalg.norm(coarse - middle) / np.linalg.norm(middle - fine) == pytest.approx(4.0, rel=0.1)
    limit = fine + (fine - middle) / 3
    np.testing.assert_allclose(limit, elastica(F, EI, LENGTH), rtol=2e-3)
    assert limit[1] > 0.6 * LENGTH


def test_twist_and_stretch_are_those_of_the_bar():
    moment = 1e-4

    def pulled_and_twisted(body):
        forces, tip = tip_force([0.02, 0.0, 0.0])(body), body.sections.nodes[-1]
        arm = body.sections.arm[-1]
        forces[tip] += moment * np.cross([1.0, 0.0, 0.0], arm) / (arm**2).sum()
        return forces

    solved = solve(rod_problem(3, chambers((0.0, 0.0)), pulled_and_twisted), force([0.0]))
    np.testing.assert_allclose(solved.delta_e, [0.02 * LENGTH / EA, 0, 0], atol=1e-9)
    turn = rod_body(3).sections.frames(solved.state.x)[1][-1]
    np.testing.assert_allclose(Rotation.from_matrix(turn).as_rotvec(), [moment * LENGTH / GJ, 0, 0], rtol=1e-4)


def test_energy_follows_no_rigid_motion():
    body = rod_body(5)
    rng = np.random.default_rng(0)
    problem = rod_problem(5, chambers((0.0, 2.0)))
    x = problem.kinematics.advance(body.mesh.X, 0.5 * rng.standard_normal(problem.pattern.n_dof))
    turn = Rotation.from_rotvec([1.0, 2.0, -0.5])
    moved = turn.apply(x) + [5.0, -3.0, 1.0]
    first, second = response(body, x), response(body, moved)
    assert first.energy > 0 and second.energy == pytest.approx(first.energy, rel=1e-12)
    row = problem.robot.active[0]
    assert row.value(moved)[0] == pytest.approx(row.value(x)[0], rel=1e-12)


def everything(body):
    """Chambers, a cable and a contact point, which act on nodes of sections."""
    X, sections = body.mesh.X, list(body.sections.nodes)
    near, middle, tip = (
        attach_to_sections(X, sections, np.array(at), "point")
        for at in ([25.0, 3.0, 0.0], [60.0, 1.0, 3.0], [100.0, 0.0, 3.0])
    )
    cable = make_cable([near, middle, tip], np.array([0.0, 3.0, 1.0]), "cable")
    return [*chambers((0.0, 2.0), (1.0, -1.0))(body), cable, ContactPoint(middle)]


def test_residual_and_tangent_are_derivatives_of_the_lagrangian():
    """Off equilibrium, with forces on nodes and pressures on strains together."""
    problem = rod_problem(4, everything, tip_force([0.0, 1e-3, 2e-3]))
    rng = np.random.default_rng(1)
    lam = np.concatenate([[0.05, -0.03, 0.02], 0.01 * rng.standard_normal(3)])
    x = problem.kinematics.move(problem.rest, 2.0 * rng.standard_normal(problem.pattern.n_dof))
    q, h = rng.standard_normal(problem.pattern.n_dof), 1e-3

    def lagrangian(k):
        at = problem.evaluate(problem.kinematics.move(x, k * h * q), np.empty(0))
        return problem.potential(at) - lam @ at.delta

    values = {k: lagrangian(k) for k in range(-2, 3)}
    here = problem.evaluate(x, np.empty(0))
    slope = (8 * (values[1] - values[-1]) - (values[2] - values[-2])) / (12 * h)
    assert here.residual(lam) @ q == pytest.approx(slope, rel=1e-7)
    second = (-values[2] + 16 * (values[1] + values[-1]) - 30 * values[0] - values[-2]) / (12 * h * h)
    data, _ = problem.stiffness(here, lam)
    ours = q @ symmetric_product(problem.pattern, data, q[:, None])[:, 0]
    assert ours == pytest.approx(second, rel=1e-5)
    assert problem.form(here, lam, q[:, None])[0, 0] == pytest.approx(ours, rel=1e-11)


def test_a_cable_bends_a_rod_as_far_as_it_is_shortened():
    problem = rod_problem(8, lambda body: everything(body)[:3])
    solved = solve(problem, Actuation(np.eye(3)[2:], np.array([2.0]), np.zeros(3)))
    assert solved.converged and solved.delta[2] == pytest.approx(2.0)
    assert solved.state.lam[2] > 0 and solved.delta_e[1] > 5  # towards the cable
    W = solved.condensed.W
    np.testing.assert_allclose(W, W.T, atol=1e-9 * np.abs(W).max())
    assert (np.linalg.eigvalsh(W) > -1e-9 * np.abs(W).max()).all()


def test_W_and_its_slope_are_derivatives_of_whole_solves():
    problem = rod_problem(6, chambers((0.0, 2.0), (2.0, -1.0)), tip_force([0.0, 2e-3, 1e-3]))
    lam, h = np.array([0.06, 0.03]), 1e-4
    here = solve(problem, force(lam), wanted=Wanted(third_order=True))
    assert here.converged
    for k in range(2):
        ahead, behind = (solve(problem, force(lam + sign * h * np.eye(2)[k])) for sign in (1, -1))
        slope = (np.concatenate([ahead.delta_e, ahead.delta]) - np.concatenate([behind.delta_e, behind.delta])) / (
            2 * h
        )
        np.testing.assert_allclose(here.condensed.W[:, 3 + k], slope, rtol=1e-5, atol=1e-4 * np.abs(slope).max())
        by_W = (ahead.condensed.W - behind.condensed.W) / (2 * h)
        np.testing.assert_allclose(here.dW[k], by_W, atol=1e-4 * np.abs(by_W).max())


@pytest.mark.parametrize(
    ("asked", "ends"),
    [
        (force([3.0, 0.0]), {Status.OUT_OF_REACH}),  # the inner fibres are squeezed to nothing
        (force([-10.0, -10.0]), {Status.OUT_OF_REACH}),
        (displacement([1e6, 1e6]), {Status.OUT_OF_REACH, Status.SINGULAR, Status.CONVERGED}),
        (displacement([-60.0, -60.0]), {Status.OUT_OF_REACH}),
        (force([np.nan, 0.0]), {Status.NOT_FINITE}),
    ],
)
def test_what_cannot_be_ends_by_its_name_and_without_a_nan(asked, ends):
    solved = solve(rod_problem(10, chambers((0.0, 2.0), (0.0, -2.0))), asked, slack=False)
    assert solved.status in ends
    assert np.isfinite(solved.state.x).all() and np.isfinite(solved.delta).all()


def test_the_whole_range_of_pressures_is_one_step_from_rest():
    """Without external loads strains are linear in the pressures; steps are taken in strains."""
    problem = rod_problem(40, chambers((0.0, 2.0), (2.0, 0.0), (-2.0, 0.0)))
    solved = solve(problem, force([0.15, 0.1, 0.0]))
    assert solved.converged and np.linalg.norm(solved.delta_e) > 0.8 * LENGTH
    assert solved.iterations <= 2
