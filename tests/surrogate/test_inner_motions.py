"""Inner motions of a solid against the natural frequencies of its full finite elements."""

from types import SimpleNamespace

import numpy as np
import pytest
from fe_motion.moving import moving_bar

from cfem.condensed.skin import Skin
from cfem.condensed.viscosity import Viscosity
from cfem.constraint.surface import outer_surface
from cfem.equilibrium.skinned import skinned
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import displacement
from cfem.fe_motion.modes import natural_modes
from cfem.fe_motion.problem import MovingProblem
from cfem.surrogate.inner_motions import inner_motions

PULLS = (0.0, 0.3, 1.0, 4.0)  # mm


def watched(problem, modes):
    """The robot with a skin of its lowest vibrations at rest."""
    surface = outer_surface(problem.body.mesh.X, problem.body.mesh.facets)
    rest = solve(problem, displacement([0.0]), slack=False).state
    shapes = natural_modes(problem, rest, modes).shapes[surface.nodes]
    root = np.sqrt(surface.weights)[:, None]
    flat, _ = np.linalg.qr((root[:, :, None] * shapes).reshape(-1, modes))
    rows = flat.T.reshape(modes, -1, 3) / root
    skin = Skin(surface.nodes, surface.rest, surface.triangles, surface.weights, rows, np.zeros((1, 2)))
    return MovingProblem(skinned(problem.robot, skin))


@pytest.fixture(scope="module")
def sampled():
    """A bar with one cable in its plane of symmetry, and its first three frequencies, the cable held."""
    problem = watched(moving_bar([Viscosity(0.0)], element="hex8", divisions=(5, 1, 1), cables=1), 5)
    states = [solve(problem, displacement([pull]), slack=False, wanted=Wanted(mass=problem.mass)) for pull in PULLS]
    names = ("V", "V2", "V3", "loss")
    stacked = {name: np.array([getattr(state.inertia, name) for state in states]) for name in names}
    W = np.array([state.condensed.W for state in states])
    moving = SimpleNamespace(rows=problem.robot.rows, W=W, inner_M=None, **stacked)
    return moving, np.array([natural_modes(problem, state.state, 3).frequency for state in states])


def test_the_third_vibration_of_a_robot_that_hardly_moves_is_there(sampled):
    moving, full = sampled
    for motions in inner_motions(moving):
        squares = 1 / np.linalg.eigvalsh(motions.M[:, 1:, 1:])[:, ::-1]
        frequency = np.sqrt(squares[:, :3]) / (2 * np.pi)
        np.testing.assert_allclose(frequency, full, rtol=1e-4)
