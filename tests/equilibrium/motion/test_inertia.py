"""Mass and viscosity on the rows' motions: against dense algebra, finite differences of solves, and the full model's
frequencies."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
from fe_motion.moving import moving_bar, moving_rod

from cfem.condensed import Condensed
from cfem.condensed.viscosity import Viscosity
from cfem.core.errors import InputError
from cfem.equilibrium.condensation import Condensation
from cfem.equilibrium.motion.inertia import inertia, mass_of
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.fe_motion.modes import natural_modes

TAU = 2e-3
ROBOTS = {
    "solid": lambda: moving_bar([Viscosity(TAU)], element="tet10", divisions=(4, 1, 1), poisson=0.3, cables=2),
    "pressure, rigid end": lambda: moving_bar([Viscosity(TAU)], element="tet10p0", divisions=(4, 1, 1), rigid_end=True),
    "bubbles": lambda: moving_bar([Viscosity(TAU)], element="hex8", divisions=(4, 1, 1), poisson=0.3, cables=2),
    "rod": lambda: moving_rod(8, [Viscosity(TAU)], ((0.3, 0.5), (-0.5, 0.1))),
}


def solved(problem, lam, **options):
    found = solve(Problem(problem.robot), force(lam), wanted=Wanted(mass=mass_of(problem.robot), **options))
    assert found.converged
    return found


def with_factor(linear, factor):
    """What was condensed at an equilibrium, with the factor of another one."""
    condensed = Condensed(linear.problem.robot.rows, linear.W, np.zeros(len(linear.W)), linear.lam)
    return Condensation(condensed, linear.Z, linear.Z[:, :0], factor, linear.data)


def dense(problem, found):
    """A, T^T M T and H^T of all rows, in full."""
    at = problem.evaluate(found.state.x, np.empty(0))
    pattern = problem.pattern

    def full(data):
        lower = sp.csc_array((data, pattern.indices, pattern.indptr), shape=(pattern.n_dof, pattern.n_dof)).toarray()
        return lower + np.tril(lower, -1).T

    A, M = full(problem.stiffness(at, found.state.lam)[0]), full(problem.mass_data(at.x))
    return A, M, np.hstack([problem.gradients(problem.robot.effectors, at.x), at.H])


@pytest.mark.parametrize("name", ROBOTS)
def test_the_moments_are_those_of_the_dynamic_compliance(name):
    """Derivatives by w^2 of B^T (A - w^2 M)^-1 B at 0."""
    problem = ROBOTS[name]()
    found = solved(problem, [0.02, 0.01] if name == "rod" else [0.5, 0.2])
    A, M, B = dense(problem, found)
    inverse = np.linalg.inv(A)
    moment, moments = inverse @ B, []
    for _ in range(4):
        moments.append(B.T @ moment)
        moment = inverse @ (M @ moment)
    got = found.inertia
    for ours, wanted in zip((found.condensed.W, got.V, got.V2, got.V3), moments, strict=True):
        np.testing.assert_allclose(ours, wanted, atol=1e-6 * np.abs(wanted).max())


def test_the_last_moment_is_as_exact_from_the_factor_of_another_state():
    """Stiff motions among Y have a millionth of the stiffness of the softest: errors of V3 are vibrations there."""
    problem = Problem(ROBOTS["solid"]().robot)
    near, found = (solve(problem, force([pull, 0.2]), wanted=Wanted(keep=True)).linear for pull in (0.5, 0.507))
    got, _ = inertia(problem, mass_of(problem.robot), found.at, with_factor(found, near.factor))
    exact = solved(ROBOTS["solid"](), [0.507, 0.2]).inertia.V3
    size = np.sqrt(np.diag(exact))
    np.testing.assert_allclose(got.V3 / np.outer(size, size), exact / np.outer(size, size), atol=1e-9)


@pytest.mark.parametrize("name", ["solid", "rod", "bubbles"])
def test_the_loss_of_a_straight_robot_is_its_stiffness(name):
    """At rest, where all the stiffness is the material's; of solids as far as it resists shear: nu = 0."""
    problem = ROBOTS[name]()
    if name != "rod":
        problem = moving_bar(
            [Viscosity(TAU)], element=problem.robot.body.element.name, divisions=(4, 1, 1), poisson=0.0
        )
    found = solved(problem, [0.0, 0.0])
    i = found.inertia
    stiffness = np.block([[found.condensed.W, i.V], [i.V, i.V2]])
    np.testing.assert_allclose(i.loss[0], stiffness, atol=1e-6 * np.abs(stiffness).max())


@pytest.mark.parametrize("name", ROBOTS)
def test_dv_is_the_difference_of_whole_solves(name):
    problem = ROBOTS[name]()
    lam = np.array([0.02, 0.01] if name == "rod" else [0.5, 0.2])
    found = solved(problem, lam, third_order=True)
    h = 1e-3 * lam[0]
    for k in range(2):
        ahead, behind = (solved(problem, lam + sign * h * np.eye(2)[k]).inertia.V for sign in (1, -1))
        difference = (ahead - behind) / (2 * h)
        np.testing.assert_allclose(found.inertia.dV[k], difference, atol=2e-4 * np.abs(difference).max())


@pytest.mark.parametrize("name", ROBOTS)
def test_their_frequencies_are_those_of_the_full_model_from_above(name):
    """Of the Galerkin model on (Z, Y)."""
    problem = ROBOTS[name]()
    found = solved(problem, [0.02, 0.01] if name == "rod" else [0.5, 0.2])
    i = found.inertia
    K, M = np.block([[found.condensed.W, i.V], [i.V, i.V2]]), np.block([[i.V, i.V2], [i.V2, i.V3]])
    size = np.sqrt(np.diag(K))
    K, M = K / np.outer(size, size), M / np.outer(size, size)
    kept = np.linalg.eigh(K)
    basis = kept.eigenvectors[:, kept.eigenvalues > 1e-9] / np.sqrt(kept.eigenvalues[kept.eigenvalues > 1e-9])
    squares = 1 / scipy.linalg.eigvalsh(basis.T @ M @ basis)[::-1]
    full = natural_modes(problem, found.state, 2, force(np.zeros(2))).frequency
    ours = np.sqrt(squares[:2]) / (2 * np.pi)
    bare = natural_modes(type(problem)(replace(problem.robot, viscosity=())), found.state, 2, force(np.zeros(2)))
    assert (ours >= bare.frequency * (1 - 1e-6)).all()
    np.testing.assert_allclose(ours, full, rtol=2e-3)


def test_it_costs_no_factorisation():
    problem = Problem(ROBOTS["solid"]().robot)
    bare, moving = (
        solve(problem, displacement([2.0, 1.0])),
        solve(problem, displacement([2.0, 1.0]), wanted=Wanted(mass=mass_of(problem.robot), third_order=True)),
    )
    assert bare.inertia is None and moving.inertia is not None
    assert moving.factorizations == bare.factorizations


def test_no_density_says_so():
    robot = replace(ROBOTS["solid"]().robot, density=None)
    with pytest.raises(InputError, match="density"):
        mass_of(robot)
