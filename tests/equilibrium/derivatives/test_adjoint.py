"""Gradients of numbers of a state and its W, against whole solves of the robots on either side."""

from dataclasses import replace
from itertools import cycle, product

import numpy as np
import pytest
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.core.errors import InputError
from cfem.equilibrium.condensation import ENOUGH
from cfem.equilibrium.derivatives.adjoint import Weights, gradients
from cfem.equilibrium.derivatives.jacobian import jacobian
from cfem.equilibrium.derivatives.parameter_slopes import Sides
from cfem.equilibrium.fields import Strain, Stress
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.body import with_materials
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material

EXACT = NewtonSettings(tolerance=1e-12)
HELD = {"displacement": actuation.displacement([2.0, 3.5]), "force": actuation.force([0.3, 0.6])}

FIELDS = {"strain": Strain(), "stress": Stress()}


def of_poisson(robot, nu):
    return replace(robot, body=with_materials(robot.body, [Material(LAWS["neo-hookean"], 1.0, nu)]))


def of_weight(robot, factor):
    return replace(robot, loads=factor * robot.loads)


CASES = {
    "tet4, poisson": (of_poisson, 0.42, dict(element="tet4", poisson=0.4)),
    "tet10p0, poisson": (of_poisson, 0.42, dict(poisson=0.45)),
    "hex8, poisson": (of_poisson, 0.42, dict(element="hex8", poisson=0.4)),
    "weight, contact free": (of_weight, 1.3, dict(weight=0.01, contact=True)),
}


def numbers(problem, seed=0):
    """Weights of three numbers: of W alone, of all but W, of everything."""
    rng, n, n_a, n_e = np.random.default_rng(seed), problem.robot.rows.n, problem.n_active, problem.robot.rows.n_e
    G = rng.normal(size=(n, n))
    G, d, l, rest = G + G.T, rng.normal(size=n), rng.normal(size=n_a), rng.normal(size=n_e)
    return [Weights(G, 0 * d, 0 * l, 0 * rest), Weights(0 * G, d, l, rest), Weights(G, d, l, rest)]


def values(asked, state, robot, problem=None):
    delta = np.concatenate([state.delta_e, state.delta])
    found = []
    for one in asked:
        number = np.sum(one.G * state.condensed.W) + one.d @ delta + one.l @ state.state.lam + one.rest @ robot.rest_e
        at = problem.evaluate(state.state.x, np.empty(0)) if one.fields else None
        found.append(number + sum(c * field.value(problem, at) for c, field in one.fields))
    return np.array(found)


def by_solves(family, base, p, asked_for, asked, start, step=1e-3):
    """Richardson's rule on whole solves; asked: Weights."""

    def slope(h):
        ends = []
        for sign in (-1, 1):
            robot = family(base, p + sign * h)
            problem = Problem(robot)
            state = solve(problem, asked_for, replace(start, x=start.x + robot.X - base.X), settings=EXACT)
            assert state.converged
            ends.append(values(asked, state, robot, problem))
        return (ends[1] - ends[0]) / (2 * h)

    return (4 * slope(step) - slope(2 * step)) / 3


def either_side(family, base, p, problem, h=1e-5):
    return Sides(*(Problem(family(base, p + sign * h), like=problem) for sign in (-1, 1)), 2 * h)


@pytest.mark.parametrize("case, kind", fast_are(zip(CASES, cycle(HELD)), product(CASES, HELD)))
def test_they_are_those_of_whole_solves(case, kind):
    family, p, options = CASES[case]
    base = bar(divisions=(5, 1, 1), **options)
    problem = Problem(family(base, p))
    state = solve(problem, HELD[kind], settings=EXACT, wanted=Wanted(keep=True))
    asked = numbers(problem)
    found = gradients(state.linear, asked, [either_side(family, base, p, problem)])
    assert found.refined <= 10 * ENOUGH
    expected = by_solves(family, base, p, HELD[kind], asked, state.state)
    np.testing.assert_allclose(found.dJ[:, 0], expected, rtol=2e-6, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize("kind", HELD)
def test_a_cable_that_alone_changes_costs_no_response_of_the_body(kind, monkeypatch):
    base = bar(divisions=(5, 1, 1))

    def family(robot, offset):
        """Its pull point moved up."""
        first = robot.actuators[0]
        start = first.start - offset * np.outer(np.arange(len(first.start)) == 0, [0, 0, 1])
        return replace(robot, actuators=(replace(first, start=start).at_rest(robot.X), robot.actuators[1]))

    problem = Problem(family(base, 0.2))
    state = solve(problem, HELD[kind], settings=EXACT, wanted=Wanted(keep=True))
    asked = numbers(problem)
    side = either_side(family, base, 0.2, problem)
    expected = by_solves(family, base, 0.2, HELD[kind], asked, state.state, step=1e-2)
    for one in (side.behind, side.ahead):
        monkeypatch.setattr(one, "evaluate", None)
    found = gradients(state.linear, asked, [side])
    np.testing.assert_allclose(found.dJ[:, 0], expected, rtol=2e-6, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize(
    "element, kind, field",
    fast_are(
        [("tet10p0", "displacement", "stress"), ("hex8", "force", "strain"), ("hex8", "displacement", "stress")],
        product(["tet10p0", "hex8"], HELD, FIELDS),
    ),
)
def test_strain_and_stress(element, kind, field):
    field = FIELDS[field]
    base = bar(element, divisions=(5, 1, 1), poisson=0.45)
    problem = Problem(of_poisson(base, 0.42))
    state = solve(problem, HELD[kind], settings=EXACT, wanted=Wanted(keep=True))
    n, n_a, n_e = problem.robot.rows.n, problem.n_active, problem.robot.rows.n_e
    asked = [Weights(np.zeros((n, n)), np.zeros(n), np.zeros(n_a), np.zeros(n_e), ((1.7, field),))]
    found = gradients(state.linear, asked, [either_side(of_poisson, base, 0.42, problem)])
    expected = by_solves(of_poisson, base, 0.42, HELD[kind], asked, state.state)
    np.testing.assert_allclose(found.dJ[:, 0], expected, rtol=1e-5)
    at = state.linear.at
    assert 0.4 * field.largest(problem, at) < field.value(problem, at) <= field.largest(problem, at)


def test_strain_of_a_uniform_stretch_and_stress_of_a_simple_shear():
    """Of homogeneous deformations a mean of any power is the value itself: 0.3, and sqrt(3) mu gamma in shear of small
    gamma (von Mises)."""
    problem = Problem(bar(divisions=(2, 1, 1), poisson=0.3))
    stretched = problem.evaluate(problem.rest * [1.3, 0.95, 0.95], np.empty(0))
    assert Strain().value(problem, stretched) == pytest.approx(0.3, rel=1e-12)
    gamma, X = 1e-6, problem.rest
    sheared = problem.evaluate(X + gamma * np.outer(X[:, 1], [1, 0, 0]), np.empty(0))
    assert Stress().value(problem, sheared) == pytest.approx(np.sqrt(3) * gamma / 2.6, rel=1e-4)


BARS = {"plain": dict(poisson=0.45), "rigid": dict(rigid_end=True), "weight": dict(weight=0.01, contact=True)}


@pytest.mark.parametrize("robot, kind", fast_are(zip(BARS, cycle(HELD)), product(BARS, HELD)))
def test_the_jacobian_is_that_of_whole_solves_rigid_groups_included(robot, kind):
    base, p = bar(divisions=(5, 1, 1), **BARS[robot]), 0.42
    problem = Problem(of_poisson(base, p))
    state = solve(problem, HELD[kind], settings=EXACT, wanted=Wanted(keep=True))
    found = jacobian(state.linear, [either_side(of_poisson, base, p, problem)])
    asked = numbers(problem)
    mine = [
        np.sum(one.G * found.W[:, :, 0])
        + one.d @ found.delta[:, 0]
        + one.l @ found.lam[:, 0]
        + one.rest @ found.rest_e[:, 0]
        for one in asked
    ]
    expected = by_solves(of_poisson, base, p, HELD[kind], asked, state.state)
    np.testing.assert_allclose(mine, expected, rtol=5e-6, atol=2e-6 * np.abs(expected).max())


def test_neither_costs_a_factorisation(monkeypatch):
    base = bar(divisions=(4, 1, 1))
    problem = Problem(of_poisson(base, 0.42))
    plain, kept = (solve(problem, HELD["displacement"], wanted=Wanted(keep=keep)) for keep in (False, True))
    assert plain.linear is None and kept.factorizations == plain.factorizations
    monkeypatch.setattr(Problem, "factor", None)
    side = either_side(of_poisson, base, 0.42, problem)
    gradients(kept.linear, numbers(problem), [side])
    jacobian(kept.linear, [side])


def test_the_adjoint_refuses_what_it_cannot_do():
    problem = Problem(bar(divisions=(4, 1, 1), rigid_end=True))
    state = solve(problem, HELD["displacement"], wanted=Wanted(keep=True))
    with pytest.raises(InputError, match="rigid groups"):
        gradients(state.linear, numbers(problem), [])
