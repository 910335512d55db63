"""W of what is attached through a region of 2 mm has a limit under refinement; of what is attached to a point, none.

The displacement under a force on a mathematical point of a solid is infinite (Boussinesq's and Kelvin's solutions,
~ 1/r), so that on elements of size h the point's self-compliance grows like 1/h."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from support.blocks import bar, box_body
from support.fast_cases import fast_are

from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.constraint.contact import make_contact
from cfem.constraint.effector import make_effector
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem

# n of three meshes; behind them the orders of W measured for a region.
FAST = {"tet10p0": (1, 2, 3), "hex8": (2, 4, 6)}  # 1.3, 1.0
SLOW = {"tet4": (3, 6, 12), "tet10p0": (2, 4, 6), "hex8": (6, 9, 12)}  # 1.2, 1.7, 1.6; (3, 6, 9): 0.7


def compliance(element, n, radius):
    """(4, 4) mm/N: W at rest of a cable and a contact point of a 12 x 8 x 8 mm block in 3 n x 2 n x 2 n cubes.
    Both sit on nodes of every mesh, so that it does not matter where in its element a point lies."""
    body = box_body((12, 8, 8), (3 * n, 2 * n, 2 * n), element, poisson=0.3)
    mesh = body.mesh
    guide = attach(mesh, np.array([8.0, 4.0, 0.0]), radius, "cable")
    robot = replace(
        bar(cables=1, contact=True),
        body=body,
        fixed=np.flatnonzero(mesh.X[:, 0] < 1e-9),
        actuators=(make_cable([guide], np.array([0.0, 4.0, 0.0]), "cable"),),
        contacts=(make_contact(mesh, np.array([8.0, 4.0, 8.0]), radius, "touch"),),
        effectors=(make_effector(mesh, np.array([12.0, 4.0, 4.0]), 2.0, 4.0, "tip"),),
    )
    state = solve(Problem(robot), actuation.force(np.zeros(4)))
    assert state.converged
    return state.condensed.W[3:, 3:]


def changes(element, divisions, radius):
    """(2, 4, 4) mm/N: from one to the next of three meshes."""
    return np.diff([compliance(element, n, radius) for n in divisions], axis=0)


def order(steps, divisions):
    """Exponent p of an error ~ n^-p whose changes over three meshes are of the sizes of `steps` (Frobenius)."""
    first, last = np.linalg.norm(steps, axis=(1, 2))

    def off(p):
        a, b, c = np.array(divisions, float) ** -p
        return np.log((a - b) / (b - c)) - np.log(first / last)

    return brentq(off, -6.01, 9.03)  # (not through 0)


def check_region(element, divisions):
    steps = changes(element, divisions, 2.0)
    assert (np.diag(steps[1]) < 0.6 * np.diag(steps[0])).all()
    assert order(steps, divisions) > 0.9


def check_point(element, divisions):
    steps = changes(element, divisions, 0.0)
    assert order(steps, divisions) == pytest.approx(-1, abs=0.05)
    assert (np.diag(steps[1]) > 0.9 * np.diag(steps[0])).all()


@pytest.mark.parametrize("element", fast_are({"tet10p0"}, FAST))
def test_W_at_a_region_converges(element):
    check_region(element, FAST[element])


@pytest.mark.parametrize("element", fast_are({"hex8"}, FAST))
def test_W_at_a_point_grows_without_bound(element):
    check_point(element, FAST[element])


@pytest.mark.slow
@pytest.mark.parametrize("element", SLOW)
def test_W_at_a_region_converges_on_fine_meshes(element):
    check_region(element, SLOW[element])


@pytest.mark.slow
def test_W_at_a_point_grows_without_bound_on_fine_meshes():
    check_point("hex8", SLOW["hex8"])
