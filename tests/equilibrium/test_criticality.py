"""Why load paths end: the softest mode against a dense eigenproblem, and arches that snap through."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import null_space
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.equilibrium.criticality import softest_mode
from cfem.equilibrium.newton import NewtonResult
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Status
from cfem.mechanics.mass import gravity
from cfem.stability.families.buckling import arch


@pytest.mark.parametrize("actuation", [force(np.zeros(2)), displacement(np.zeros(2))], ids=["forces", "displacements"])
def test_the_softest_mode_is_that_of_the_motions_left_free(actuation):
    problem = Problem(bar(element="hex8", divisions=(6, 1, 1)))
    at, none = problem.evaluate(problem.rest, np.empty(0), 0.0), np.zeros(2)
    tangent = problem.factor(at, none, SolveCost())
    A = np.linalg.inv(tangent.factor.solve(np.eye(problem.pattern.n_dof)))
    held = at.H @ actuation.C.T
    free = null_space(held.T) if held.shape[1] else np.eye(len(A))
    value, mode, reactions = softest_mode(
        problem,
        NewtonResult(Status.CONVERGED, at, none, tangent, 0.0, 0.0, 0, np.ones(len(actuation.C), dtype=bool)),
        actuation,
    )
    assert value == pytest.approx(np.linalg.eigvalsh(free.T @ A @ free)[0], rel=1e-5)
    assert np.linalg.norm(mode) == pytest.approx(1.0) and np.abs(held.T @ mode).max(initial=0.0) < 1e-10
    np.testing.assert_allclose(A @ mode + held @ reactions, value * mode, atol=2e-3 * value)


@pytest.mark.parametrize("weight", fast_are({1e-5}, [0.0, 1e-5]))
def test_an_arch_pulled_at_its_crown_or_by_its_weight_turns_back_at_a_limit_point(weight):
    shallow = arch("tet10")
    if weight:
        shallow = replace(shallow, loads=gravity(shallow.body, weight, np.array([0.0, 0.0, -1.0])))
    found = solve(Problem(shallow), force(np.array([0.0 if weight else 0.006])))
    assert found.status is Status.LIMIT_POINT
