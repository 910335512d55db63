"""d2C/dw2 is the derivative of dC/dw of solves under loads, and the fourth derivative of one energy."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.condensed.packing import packed_indices
from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.plant.fem_plant import pushed

EXACT = NewtonSettings(tolerance=1e-12)
ROBOTS = {
    "hex8, ogden": dict(element="hex8", law="ogden", poisson=0.4),
    "tet10p0": dict(poisson=0.3),
    "rigid end": dict(rigid_end=True),
    "weight, contact free": dict(weight=0.01, contact=True),
}


@pytest.mark.parametrize("name", fast_are({"hex8, ogden", "rigid end"}, ROBOTS))
def test_it_is_the_derivative_of_that_of_loaded_solves(name):
    problem = Problem(bar(divisions=(4, 1, 1), **ROBOTS[name]))
    at = solve(problem, actuation.displacement([2.0, 3.5]), settings=EXACT, slack=False, wanted=Wanted(loads=2))
    assert at.converged
    packed, size = at.d2C, np.abs(at.d2C).max()
    i, j, k, m = packed_indices(3, 4)

    def change(push):
        loaded = solve(
            Problem(pushed(problem.robot, push)),
            actuation.displacement(at.delta_a),
            at.state,
            None,
            EXACT,
            slack=False,
            wanted=Wanted(loads=1),
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


def test_a_row_that_the_actuators_lock_has_that_of_loaded_solves_too():
    """A cable along the axis holds the end in x: a wrench there moves nothing but by rounding. It bends with y, so that
    x does not stay locked under a force across."""
    robot = bar(divisions=(4, 1, 1), element="hex8", poisson=0.3, cables=1)
    end = attach(robot.body.mesh, np.array([60.0, 5.0, 5.0]), 2.0, "cable-0")
    robot = replace(robot, actuators=(make_cable([end], np.array([0.0, 5.0, 5.0]), "cable-0"),))
    held = dict(settings=EXACT, slack=False)
    at = solve(Problem(robot), actuation.displacement([0.0]), wanted=Wanted(loads=2), **held)
    W = at.condensed.W
    assert (W[0, 0] - W[0, 3] ** 2 / W[3, 3]) / W[0, 0] < 1e-10
    step = 0.05 / W[1, 1] * np.eye(3)[1]
    ahead, behind = (
        solve(
            Problem(pushed(robot, side * step)), actuation.displacement([0.0]), at.state, wanted=Wanted(loads=1), **held
        ).dC
        for side in (1, -1)
    )
    slope, size = (ahead - behind) / (2 * step[1]), np.sqrt(np.diag(W)[:3])
    rows, scale = packed_indices(3, 4), 5.0
    packed = at.d2C / size[rows].prod(axis=0)
    mine = (rows == 1).any(axis=0)
    others = np.array([np.delete(one, one.tolist().index(1)) for one in rows.T[mine]]).T
    expected = slope[*others] / (size[others].prod(axis=0) * size[1])
    assert expected.max() > scale
    np.testing.assert_allclose(packed[mine], expected, rtol=0, atol=1e-3 * scale)
    assert np.abs(packed[~mine]).max() < 2 * scale
