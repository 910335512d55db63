"""The lowest natural frequency: against dense eigenvalues, and its gradient against whole solves, at pulled states."""

from dataclasses import replace
from itertools import cycle, product

import numpy as np
import pytest
from equilibrium.derivatives.test_adjoint import CASES, EXACT, HELD, either_side, of_poisson
from scipy.linalg import eigh, null_space
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.core.errors import NumericalError
from cfem.equilibrium.derivatives.adjoint import Weights, gradients
from cfem.equilibrium.derivatives.parameter_slopes import Sides
from cfem.equilibrium.motion.inertia import mass_of, times_mass
from cfem.equilibrium.motion.vibration import lowest
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.fe_motion.modes import natural_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.mechanics.body import on_nodes
from cfem.mechanics.mass import kinetic_form, mass_matrix

DENSITY = 1.07e-9


def dense(robot):
    return replace(robot, density=np.full(len(robot.body.mesh.cells), DENSITY))


def pulled(robot, held=HELD["displacement"], start=None):
    problem = Problem(robot)
    state = solve(problem, held, start, settings=EXACT, wanted=Wanted(keep=True))
    assert state.converged
    return problem, state


@pytest.mark.parametrize("held", [True, False])
def test_it_is_that_of_the_full_matrices(held):
    robot = dense(bar(divisions=(4, 1, 1)))
    problem, state = pulled(robot)
    linear, n = state.linear, problem.pattern.n_dof
    A = np.zeros((n, n))
    A[problem.pattern.indices, np.repeat(np.arange(n), np.diff(problem.pattern.indptr))] = linear.data
    A = A + np.tril(A, -1).T
    M = times_mass(problem, mass_of(robot), linear.at.x, np.eye(n))
    N = null_space(linear.at.H[:, : robot.rows.n_a].T) if held else np.eye(n)
    square = eigh(N.T @ A @ N, N.T @ M @ N, eigvals_only=True)[0]
    found = lowest(linear, mass_of(robot), held)
    assert found.frequency == pytest.approx(np.sqrt(square) / (2 * np.pi), rel=1e-8)
    modes = natural_modes(MovingProblem(robot), state.state, 1, None if held else actuation.force([0.0, 0.0]))
    assert found.frequency == pytest.approx(modes.frequency[0], rel=1e-7)


def of_height(robot, factor):
    """The body higher by a factor: its mass, its stiffness and its cables' places change."""
    mesh = replace(robot.body.mesh, X=robot.X * [1.0, 1.0, factor])
    return replace(
        robot, body=on_nodes(robot.body, mesh), actuators=tuple(one.at_rest(mesh.X) for one in robot.actuators)
    )


def of_density(robot, factor):
    return replace(robot, density=factor * robot.density)


CHANGES = {name: case for name, case in CASES.items() if "weight" not in name} | {
    "height": (of_height, 1.1, dict(poisson=0.4)),
    "density": (of_density, 1.3, dict(element="tet4", poisson=0.4)),
}


@pytest.mark.parametrize(
    "change, kind, loose",
    fast_are(zip(CHANGES, cycle(HELD), cycle([False, False, True, True])), product(CHANGES, HELD, [False, True])),
)
def test_its_gradient_is_that_of_whole_solves(change, kind, loose):
    family, p, options = CHANGES[change]
    base = dense(bar(divisions=(4, 1, 1), **options))
    problem, state = pulled(family(base, p), HELD[kind])
    found = lowest(state.linear, mass_of(problem.robot), not loose)
    n, n_a, n_e = problem.robot.rows.n, problem.n_active, problem.robot.rows.n_e
    asked = Weights(np.zeros((n, n)), np.zeros(n), np.zeros(n_a), np.zeros(n_e), (), ((found.share, found.columns),))
    side = either_side(family, base, p, problem)
    slope = gradients(state.linear, [asked], [side]).dJ[0, 0]

    def at(q):
        _, there = pulled(family(base, q), HELD[kind])
        return lowest(there.linear, mass_of(there.linear.problem.robot), not loose).frequency

    h = 2e-3
    expected = (8 * (at(p + h) - at(p - h)) - (at(p + 2 * h) - at(p - 2 * h))) / (12 * h)
    assert slope == pytest.approx(expected, rel=1e-5)


def test_modes_of_one_frequency_have_the_gradient_of_their_mean():
    """A bar of a square section that no cable pulls bends either way at one frequency: by Poisson's ratio both change
    alike, and the gradient is theirs."""
    base = dense(bar("hex8", divisions=(5, 1, 1), poisson=0.3))
    rest = actuation.force([0.0, 0.0])
    problem, state = pulled(of_poisson(base, 0.3), rest)
    found = lowest(state.linear, mass_of(problem.robot), False)
    assert len(found.columns.m) == 2
    n, n_a, n_e = problem.robot.rows.n, problem.n_active, problem.robot.rows.n_e
    asked = Weights(np.zeros((n, n)), np.zeros(n), np.zeros(n_a), np.zeros(n_e), (), ((found.share, found.columns),))
    sides = Sides(*(Problem(of_poisson(base, q), like=problem) for q in (0.29999, 0.30001)), 2e-5)
    ends = []
    for q in (0.299, 0.301):
        _, there = pulled(of_poisson(base, q), rest)
        ends.append(lowest(there.linear, mass_of(problem.robot), False).frequency)
    problem, state = pulled(of_poisson(base, 0.3), rest)
    slope = gradients(state.linear, [asked], [sides]).dJ[0, 0]
    assert slope == pytest.approx((ends[1] - ends[0]) / 2e-3, rel=1e-4)


@pytest.mark.parametrize("element", ["tet4", "tet10p0", "hex8"])
def test_the_kinetic_form_is_that_of_the_mass_matrix(element):
    body = bar(element, divisions=(3, 1, 1)).body
    density = DENSITY * np.linspace(1, 2, len(body.mesh.cells))
    motions = np.random.default_rng(0).normal(size=(len(body.mesh.X), 3, 2))
    M = mass_matrix(body, density)
    expected = [sum(v @ (M @ v) for v in motions[:, :, k].T) for k in range(2)]
    np.testing.assert_allclose(kinetic_form(body, density, motions), expected, rtol=1e-12)


@pytest.mark.parametrize(("held", "part"), [(True, "stand still"), (False, "pull with constant forces")])
def test_an_unstable_equilibrium_has_no_frequency(held, part, monkeypatch):
    robot = dense(bar(divisions=(3, 1, 1)))
    _, state = pulled(robot)
    grows = np.array([-1.0, 2.0]), np.zeros((1, 2)), np.zeros((2 if held else 0, 2))
    monkeypatch.setattr("cfem.equilibrium.motion.vibration.lowest_modes", lambda *_: grows)
    with pytest.raises(NumericalError, match=part):
        lowest(state.linear, mass_of(robot), held)
