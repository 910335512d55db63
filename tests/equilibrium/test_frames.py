"""A robot that is turned and shifted as a whole, its weight too, has the same W, displacements and forces, to rounding:
rows of effectors and contacts turn, all else is the same numbers."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation
from support.blocks import bar

from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem

TURN = Rotation.from_euler("zyx", [37, -20, 65], degrees=True).as_matrix()
SHIFT = np.array([120.0, -45.0, 30.0])


@pytest.mark.parametrize(
    "options",
    [
        dict(element="tet4", law="corotational", poisson=0.3),
        dict(element="tet10p0", weight=0.01, contact=True),
        dict(element="hex8", law="ogden", poisson=0.4, rigid_end=True),
    ],
    ids=["tet4", "tet10p0, weight, contact", "hex8, rigid end"],
)
def test_a_turned_and_shifted_robot_is_the_same_robot(options):
    here, there = (
        solve(
            Problem(bar(divisions=(5, 2, 2), **options, **frame)),
            actuation.displacement([3.0, 2.0]),
            settings=NewtonSettings(tolerance=1e-12),
        )
        for frame in ({}, {"turn": TURN, "shift": SHIFT})
    )
    assert here.converged and there.converged
    turned = block_diag(TURN, np.eye(2), *([TURN] if options.get("contact") else []))
    W = turned @ here.condensed.W @ turned.T
    np.testing.assert_allclose(there.condensed.W, W, rtol=0, atol=1e-10 * np.abs(W).max())
    np.testing.assert_allclose(there.condensed.delta_free, turned @ here.condensed.delta_free, rtol=0, atol=1e-9)
    np.testing.assert_allclose(there.lambda_a, here.lambda_a, rtol=1e-10)
    np.testing.assert_allclose(there.delta_e, TURN @ here.delta_e, rtol=0, atol=1e-10)
    assert there.energy == pytest.approx(here.energy, rel=1e-10)
