"""How a force on a patch of the surface changes what the patch and the effectors yield, against solves with it."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar
from support.fast_cases import fast_are

from cfem.condensed.patches import cut
from cfem.condensed.skin import Skin
from cfem.constraint.surface import outer_surface
from cfem.equilibrium.contact.patch_compliance import patch_response, with_patches
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system import actuation
from cfem.equilibrium.system.problem import Problem
from cfem.plant.fem_plant import pushed

DELTA = np.array([2.0, 3.5])
EXACT = NewtonSettings(tolerance=1e-12)


@pytest.mark.parametrize("rigid_end", fast_are({True}, [False, True]))
def test_dents_are_the_derivative_of_loaded_solves(rigid_end):
    robot = bar(divisions=(5, 1, 1), rigid_end=rigid_end)
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    modes = np.ones((1, *surface.rest.shape)) / len(surface.rest)
    skin = Skin(surface.nodes, surface.rest, surface.triangles, surface.weights, modes, np.zeros((1, 2)))
    patches = cut(surface.rest, surface.weights, 20.0, surface.triangles)
    found = patch_response(robot, skin, patches, DELTA[None])
    number = int(np.argmax(np.diag(found.own[0]).reshape(-1, 3).sum(axis=1)))
    D = found.dented[0, number]
    touched = with_patches(robot, surface.nodes, patches, np.array([number]))

    def yields(push):
        rows = replace(touched.rows, effectors=("x", "y", "z", *touched.rows.effectors), contacts=())
        watched = replace(touched, effectors=(*touched.contacts, *touched.effectors), contacts=(), rows=rows)
        at = solve(
            Problem(pushed(watched, np.append(push, np.zeros(3)))),
            actuation.displacement(DELTA),
            settings=EXACT,
            slack=False,
        )
        W, e, a = at.condensed.W, watched.rows.e, watched.rows.a
        return (W[e, e] - W[e, a] @ np.linalg.solve(W[a, a], W[a, e]))[:3]

    h = 1e-4 / np.abs(np.linalg.eigvalsh(yields(np.zeros(3))[:, :3])).max()
    for k in range(3):
        step = h * np.eye(3)[k]
        expected = (yields(step) - yields(-step)) / (2 * h)
        np.testing.assert_allclose(D[k], expected, rtol=0, atol=1e-5 * np.abs(D).max())
