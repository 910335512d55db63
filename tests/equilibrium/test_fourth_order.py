"""d2C/dw2 is the derivative of dC/dw of solves under loads, and the fourth derivative of one energy."""

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed.packing import symmetric4_indices
from cfem.equilibrium import actuation
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.solve import solve
from cfem.plant.fem_plant import pushed

EXACT = Settings(tolerance=1e-12)
ROBOTS = {
    "hex8, ogden": dict(element="hex8", law="ogden", poisson=0.4),
    "tet10p0": dict(poisson=0.3),
    "rigid end": dict(rigid_end=True),
    "weight, contact free": dict(weight=0.01, contact=True),
}


@pytest.mark.parametrize("robot", ROBOTS.values(), ids=ROBOTS)
def test_it_is_the_derivative_of_that_of_loaded_solves(robot):
    problem = Problem(bar(divisions=(4, 1, 1), **robot))
    at = solve(problem, actuation.displacement([2.0, 3.5]), settings=EXACT, loads=2, slack=False)
    assert at.converged
    packed, size = at.d2C, np.abs(at.d2C).max()
    i, j, k, m = symmetric4_indices(3)

    def change(push):
        loaded = solve(
            Problem(pushed(problem.robot, push)),
            actuation.displacement(at.delta_a),
            at.state,
            None,
            EXACT,
            loads=1,
            slack=False,
        )
        assert loaded.converged
        return loaded.dC

    C = at.condensed.W[:3, :3]
    h = 0.05 / np.abs(np.linalg.eigvalsh(C)).max()
    for row in range(3):
        step = h * np.eye(3)[row]
        slope = (change(step) - change(-step)) / (2 * h)
        mine = m == row
        np.testing.assert_allclose(packed[mine], slope[i, j, k][mine], rtol=0, atol=3e-3 * size)
