"""How a state follows a parameter at constant delta_a, against whole solves of the robots on either side."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.equilibrium.derivatives.parameter_slopes import Sides
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.body import with_materials
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material

EXACT = NewtonSettings(tolerance=1e-12)
ASKED = actuation.displacement([2.0, 3.5])
ROBOTS = {
    "tet4": dict(element="tet4", poisson=0.4),
    "tet10p0": dict(poisson=0.45),
    "hex8": dict(element="hex8", poisson=0.4),
    "rigid end": dict(rigid_end=True),
    "weight, contact free": dict(weight=0.01, contact=True),
}


def of_poisson(robot, nu):
    return replace(robot, body=with_materials(robot.body, [Material(LAWS["neo-hookean"], 1.0, nu)]))


def of_weight(robot, factor):
    return replace(robot, loads=factor * robot.loads)


def of_radius(_, radius):
    return bar(divisions=(5, 1, 1), radius=radius)


CASES = {name: (of_poisson, 0.42, options) for name, options in ROBOTS.items()} | {
    "by weight": (of_weight, 1.3, ROBOTS["weight, contact free"]),
    "by radius of the attachments": (of_radius, 2.2, {}),
}
FEW = {"hex8", "rigid end", "by weight", "by radius of the attachments"}


@pytest.mark.parametrize("case", fast_are(FEW, CASES))
def test_they_are_those_of_whole_solves_at_constant_displacement(case):
    family, p, options = CASES[case]
    base = bar(divisions=(5, 1, 1), **options)
    problem, h = Problem(family(base, p)), 1e-5
    sides = Sides(*(Problem(family(base, p + sign * h), like=problem) for sign in (-1, 1)), 2 * h)
    state = solve(problem, ASKED, settings=EXACT, wanted=Wanted(sides=[sides]))
    assert state.converged

    def ends(step):
        found = [solve(Problem(family(base, p + sign * step)), ASKED, state.state, settings=EXACT) for sign in (-1, 1)]
        assert all(one.converged for one in found)
        return [(one.energy, one.lambda_a, one.state.x, one.delta_e) for one in found]

    def slope(part):
        """Richardson's rule on whole solves."""
        near, far = ((ahead[part] - behind[part]) / (2 * step) for step, (behind, ahead) in solved.items())
        return (4 * near - far) / 3

    solved = {step: ends(step) for step in (1e-3, 2e-3)}
    slopes = state.slopes
    assert slopes.psi[0] == pytest.approx(slope(0), rel=1e-6)
    for found, part in ((slopes.lam, 1), (slopes.x, 2), (slopes.delta_e, 3)):
        expected = slope(part)
        np.testing.assert_allclose(found[..., 0], expected, rtol=0, atol=2e-6 * np.abs(expected).max())


def test_a_robot_of_another_material_on_the_same_factorisation_is_the_robot_built_anew():
    first = Problem(bar(divisions=(4, 1, 1), poisson=0.3))
    swapped = Problem(of_poisson(first.robot, 0.49), like=first)
    anew = Problem(bar(divisions=(4, 1, 1), poisson=0.49))
    a, b = (solve(problem, ASKED) for problem in (swapped, anew))
    np.testing.assert_array_equal(a.condensed.W, b.condensed.W)
    again = solve(first, ASKED)  # and the first is none the worse for it
    np.testing.assert_array_equal(
        again.condensed.W, solve(Problem(bar(divisions=(4, 1, 1), poisson=0.3)), ASKED).condensed.W
    )


def test_they_cost_no_factorisation():
    problem = Problem(bar(divisions=(4, 1, 1)))
    sides = Sides(*(Problem(of_poisson(problem.robot, nu), like=problem) for nu in (0.449, 0.451)), 0.002)
    plain, more = (solve(problem, ASKED, wanted=Wanted(sides=given)) for given in ([], [sides]))
    assert plain.slopes is None and more.factorizations == plain.factorizations
