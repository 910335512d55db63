"""Finite elements that meet rigid obstacles between the nodes of their surface, against finer meshes and a search over
the surface."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import bar

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.law.sliding import PARTS
from cfem.contact.obstacle import Box, Capsule, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene

PLACE, DEPTHS = np.array([41.3, 4.3, 10.0]), (0.2, 0.6, 1.0)
STANDS_ON_CORNER = np.vstack(
    [np.array([0, 1, -1]) / np.sqrt(2), np.array([-2, 1, 1]) / np.sqrt(6), np.ones(3) / np.sqrt(3)]
)
OBSTACLES = {
    "ball": (3.0, lambda t: Sphere(3.0, t=t)),
    "capsule": (2.0, lambda t: Capsule(2.0, 6.0, R=Rotation.from_rotvec([0, np.pi / 2, 0]).as_matrix(), t=t)),
    "edge": (11.2, lambda t: Box(np.full(3, 8.0), R=Rotation.from_rotvec([0, np.arcsin(0.6), 0]).as_matrix(), t=t)),
    "corner": (4 * np.sqrt(3), lambda t: Box(np.full(3, 4.0), R=STANDS_ON_CORNER, t=t)),
}


@pytest.fixture(scope="module")
def bars():
    """Bars 60 mm long and 10 mm wide and high, of cells of 5 mm, and of half of that."""
    skinned = []
    for divisions in ((12, 3, 2), (24, 6, 4)):
        robot = bar(element="hex8", divisions=divisions, cables=1)
        surface = outer_surface(robot.X, robot.body.mesh.facets)
        points = at_nodes(robot.X, robot.body.mesh.facets, surface)
        skinned.append(SkinnedRobot(robot, surface.nodes, surface.triangles, points, itself=False))
    return skinned


def pressed(skinned, kind, mu=0.0, aside=0.0):
    """The state after the obstacle has come down onto the bar, and the obstacle."""
    state, (height, shape) = None, OBSTACLES[kind]
    for depth in DEPTHS:
        obstacle = shape(PLACE + [aside * depth, 0.0, height - depth])
        state = SurfaceScene([skinned], ObstacleSet((obstacle,)), mu, PARTS).step([np.zeros(1)], state)
        assert state.converged
    return state, obstacle


@pytest.mark.parametrize("kind", OBSTACLES)
def test_forces_hardly_depend_on_the_mesh_though_a_facet_is_wider_than_what_touches(bars, kind):
    """At nodes alone they are 20 to 100 % apart, and the edge and the corner touch nothing in the coarser mesh."""
    forces = [pressed(skinned, kind)[0].forces.sum(axis=0) for skinned in bars]
    assert forces[1][2] < -0.03 and np.linalg.norm(forces[0] - forces[1]) < 0.06 * np.linalg.norm(forces[1])
    assert np.abs(forces[0][:2]).max() < 0.05 * -forces[0][2]  # without friction they are along the surface's normal


@pytest.mark.parametrize("kind", OBSTACLES)
@pytest.mark.parametrize("mu", [0.0, 0.5])
def test_the_surface_is_nowhere_in_the_obstacle(bars, kind, mu):
    state, obstacle = pressed(bars[0], kind, mu, aside=0.5)
    surface = bars[0].surface(state.solved[0].state.x)
    within = -nearest_of_surface(surface, bars[0].triangles, obstacle, 1e-4).distance
    assert -1e-3 < within < (0.02 if kind in ("ball", "capsule") else 2e-4)  # what is left between nodes: SAG


@pytest.mark.parametrize("mu, aside, slides", [(50.0, 0.0, False), (0.1, 2.0, True)])
def test_friction_holds_what_does_not_slide_and_limits_what_does(bars, mu, aside, slides):
    state, _ = pressed(bars[0], "ball", mu, aside)
    push = state.push[state.push.any(axis=1)]
    frames = state.pairs.frames[state.push.any(axis=1)]
    normal, along = (frames[:, 0] * push).sum(axis=1), np.linalg.norm(frames[:, 1:] @ push[:, :, None], axis=1)[:, 0]
    assert (normal > 0).all() and (along <= mu * normal * (1 + 1e-6)).all()
    assert (along.sum() > 0.999 * mu * normal.sum()) == slides


def test_nodes_bear_the_moment_of_a_force_between_them(bars):
    """The resultant of the forces on the nodes goes through the lowest point of the ball."""
    state, ball = pressed(bars[0], "ball")
    places = state.solved[0].state.x[bars[0].nodes][state.points]
    moment = np.cross(places - ball.t, state.forces).sum(axis=0)
    assert len(state.points) >= 3 and np.abs(moment).max() < 1e-6 * np.abs(state.forces).max()


def test_two_bars_that_meet_the_same_obstacle_have_facets_of_their_own(bars):
    height, shape = OBSTACLES["ball"]
    ball, away = shape(PLACE + [0, 0, height - 0.2]), np.array([0.0, 200.0, 0.0])
    other = SkinnedRobot(bars[0].robot, bars[0].nodes, bars[0].triangles, bars[0].patches, t=away, itself=False)
    both = SurfaceScene([other, bars[0]], ObstacleSet((ball,))).step([np.zeros(1)] * 2, None)
    alone = SurfaceScene([bars[0]], ObstacleSet((ball,))).step([np.zeros(1)], None)
    np.testing.assert_allclose(both.forces.sum(axis=0), alone.forces.sum(axis=0), rtol=1e-6)
