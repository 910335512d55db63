"""Contact of finite elements at the resolution of their mesh, against theory: Hertz, Cattaneo and Mindlin, a uniform
pressure, a slope."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from support.blocks import box
from support.fast_cases import fast_are
from support.half_space import block_robot, half_space, skinned

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.prescribed_motion import Translation
from cfem.core.spec import load_spec
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.mass import gravity
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.robot.build import build_robot
from cfem.robot.mesh.accuracy import scene_mesh
from cfem.robot.self_contact import SelfContactSpec
from cfem.robot.spec import SceneSpec

STILL = [np.zeros(0)]
RADIUS, REACH = 50.0, 1.0  # mm: of the ball, and of the contact by Hertz
DEPTH = REACH**2 / RADIUS


def ball_on(robot, points, mu=0.0):
    ball = Sphere(RADIUS, t=np.array([0.0, 0.0, RADIUS - DEPTH]))
    return ball, SurfaceScene([skinned(robot, points)], ObstacleSet((ball,)), mu)


def hertz(poisson):
    """N at DEPTH, Young's modulus 1 MPa."""
    return 4 / 3 / (1 - poisson**2) * REACH**3 / RADIUS


def force_and_reach(scene, state):
    """N, and mm by the second moment of the forces: 2/5 of the square of the radius of contact by Hertz."""
    (robot,), force = scene.robots, -state.forces[:, 2]
    nodal = robot.patches.weights[state.points].T @ force
    squares = (robot.robot.X[robot.nodes][:, :2] ** 2).sum(axis=1)
    return force.sum(), np.sqrt(2.5 * (nodal @ squares) / force.sum())


@pytest.fixture(scope="module")
def coarse():
    return half_space(1.3, 0.5, 120.0)


@pytest.mark.parametrize(
    ("points", "force_off"), [("nodes", 0.02), pytest.param("around", 0.03, marks=pytest.mark.slow)]
)
def test_a_ball_presses_a_half_space_as_hertz_says(coarse, points, force_off):
    """Cells half as large as the radius of contact. The block, held where a half space would
    move by 4 / (3 pi) a / far of the depth, should need some 0.5 % more force."""
    _, scene = ball_on(coarse, points)
    state = scene.step(STILL, None)
    force, reach = force_and_reach(scene, state)
    assert state.converged and state.factorizations <= 4
    assert force == pytest.approx(hertz(0.3), rel=force_off) and reach == pytest.approx(REACH, rel=0.02)
    assert np.abs(state.forces[:, :2]).max() < 0.03 * np.abs(state.forces).max()  # of the ball's slope


@pytest.mark.slow
def test_finer_cells_come_nearer_to_hertz():
    robots = [half_space(1.3, size, 120.0) for size in (0.5, 0.25)]
    for points in ("nodes", "around"):
        off = []
        for robot in robots:
            _, scene = ball_on(robot, points)
            force, reach = force_and_reach(scene, scene.step(STILL, None))
            off.append(force / hertz(0.3) - 1)
        assert 0.0 < off[1] < 0.02 and off[1] < off[0] and reach == pytest.approx(REACH, rel=0.02)


@pytest.mark.slow
def test_a_ball_that_is_moved_aside_slips_partly_as_cattaneo_and_mindlin_say():
    """Nearly incompressible, so that pressing alone makes no slip. Force by the way aside: Johnson, Contact Mechanics,
    1985, equation 7.42. What sticks comes out smaller, by half a cell: a point that slips in part slips."""
    nu, mu, share = 0.49, 0.4, 0.24
    ball, scene = ball_on(half_space(1.3, 0.5, 120.0, "tet10p0", poisson=nu), "around", mu)
    state = scene.step(STILL, None)
    pressed = -state.forces[:, 2].sum()
    reach = (0.75 * pressed * RADIUS * (1 - nu**2)) ** (1 / 3)
    whole = 3 * mu * pressed / (16 * reach) * (2 - nu) * 2 * (1 + nu)  # mm, where all slips
    course = Translation(ball, np.array([[0.0, 0.0, 0.0], [whole, 0.0, 0.0]]))
    for number in range(4):
        begin, end = share * number, share * (number + 1)
        memory = state.memory.carried(state.pairs, {1: course}, begin, end)
        scene = replace(scene, obstacles=ObstacleSet((course.at(end),)))
        state = scene.step(STILL, replace(state, memory=memory))
        assert state.converged and state.factorizations <= 2
        aside = state.forces[:, 0].sum() / (mu * -state.forces[:, 2].sum())
        assert aside == pytest.approx(1 - (1 - end) ** 1.5, abs=0.012)
        points = np.array(list(state.modes)) % len(scene.robots[0].patches)
        areas, modes = scene.robots[0].patches.areas[points], np.array([mode.value for mode in state.modes.values()])
        sticking = np.sqrt(areas[modes == Mode.STICK.value].sum() / areas[modes != Mode.OPEN.value].sum())
        assert sticking == pytest.approx((1 - aside) ** (1 / 3), abs=0.25)


@pytest.mark.parametrize(
    "element, points",
    fast_are(
        [("tet4", "around"), ("tet10", "nodes"), ("hex8", "around")],
        product(["tet4", "tet10", "hex8"], ["around", "nodes"]),
    ),
)
def test_a_flat_wall_presses_a_block_evenly(element, points):
    """Strain 1e-6: at more, this law of poisson 0 pushes sideways where the block is held."""
    mesh = box((4, 4, 4), (3, 3, 3), element, distort=0.2)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["neo-hookean"], 1.0, 0.0))
    robot = skinned(block_robot(body, np.flatnonzero(mesh.X[:, 2] < 1e-9), 4.0), points)
    wall = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, 4 - 4e-6]))
    state = SurfaceScene([robot], ObstacleSet((wall,))).step(STILL, None)
    force, area = -state.forces[:, 2], robot.patches.areas[state.points]
    assert state.converged and force.sum() == pytest.approx(16e-6, rel=1e-6)
    if points == "nodes":  # the areas of nodes on edges are those of both sides
        inner = (np.abs(robot.patches.rest[state.points][:, :2] - 2.0) < 1.99).all(axis=1)
        assert np.abs(force[inner & (area == 0)]).max(initial=0.0) < 1e-6 * force.max()
        force, area = force[inner & (area > 0)], area[inner & (area > 0)]
    assert force / area == pytest.approx(1e-6 * np.ones(len(force)), rel=1e-6)


@pytest.mark.parametrize("points", fast_are({"nodes"}, ["nodes", "around"]))
def test_a_block_stays_on_a_slope_or_slides_down(points):
    """A block of 1 mN hangs on a rubber band without strength, and the slope becomes steeper."""
    mesh, mu, weight = box((4, 4, 8), (2, 2, 4), "tet10"), 0.3, 1e-3
    high = np.flatnonzero(mesh.X[mesh.cells].mean(axis=1)[:, 2] > 4.0)
    band = (high, Material(LAWS["neo-hookean"], 1e-3, 0.3))
    body = make_body(mesh, ELEMENTS["tet10"], Material(LAWS["neo-hookean"], 1.0, 0.3), [band])
    density = np.full(len(mesh.cells), 1 / 64.0)
    density[high] = 0.0
    free = block_robot(body, np.flatnonzero(mesh.X[:, 2] > 8 - 1e-9), 8.0)
    state = None
    for share, degrees in ((0.02, 0.0), (1.0, 0.0), (1.0, 10.0), (1.0, 14.0), (1.0, 18.0)):
        angle = np.radians(degrees)
        down = share * weight * np.array([np.sin(angle), 0.0, -np.cos(angle)])
        robot = skinned(replace(free, loads=gravity(body, density, down)), points)
        state = SurfaceScene([robot], ObstacleSet((Plane(),)), mu).step(STILL, state)
        assert state.converged
        along, _, normal = state.forces.sum(axis=0)
        touching = {mode for mode in state.modes.values() if mode is not Mode.OPEN}
        assert normal == pytest.approx(-down[2], rel=0.02)
        if np.tan(angle) < mu:
            assert along == pytest.approx(-down[0], abs=0.02 * weight)
            assert Mode.STICK in touching
        else:
            rubbing = np.linalg.norm(state.forces[:, :2], axis=1).sum()
            assert touching == {Mode.SLIP} and rubbing == pytest.approx(mu * normal, rel=1e-8)
            assert along == pytest.approx(-rubbing, rel=1e-5)  # the block also bulges: points slide a little apart


@pytest.fixture(scope="module")
def prongs():
    """Spec and mesh of the two prongs of the pincer, of tetrahedra."""
    path = Path(__file__).parents[3] / "pipelines" / "pincer" / "scene.yaml"
    scene = load_spec(path, SceneSpec, ["mesh={size: 6 mm, element: tet10p0}"])
    return scene, scene_mesh(scene, path.parent)[0]


def test_a_body_touches_itself_at_its_nodes_as_the_energy_of_its_walls_has_it(prongs):
    """Nodes that meet the surface before them, by the law of contact, against points of quadrature that push each other
    across the gap by a pressure that begins at 0.1 % of it (`cfem.mechanics.self_contact`): no code in common, and the
    other one knows no law. By patches of 4 mm the tips would be a fifth off."""
    scene, mesh = prongs
    to = np.array([1.0, 0.9])
    pushed = build_robot(scene.model_copy(update={"self_contact": SelfContactSpec(within="7 mm", onset=0.001)}), mesh)
    judge = solve(Problem(pushed), displacement(to))
    robot = build_robot(scene, mesh)
    free, facets = solve(Problem(robot), displacement(to)), robot.body.mesh.facets
    surface = outer_surface(robot.X, facets)
    points = at_nodes(robot.X, facets, surface)
    state = SurfaceScene([SkinnedRobot(robot, surface.nodes, surface.triangles, points)]).go([to])
    assert judge.converged and state.converged
    moved = np.linalg.norm(judge.delta_e - free.delta_e)
    assert moved > 2.0 and np.linalg.norm(state.solved[0].delta_e - judge.delta_e) < 0.03 * moved
    relieved = np.abs(judge.lambda_a - free.lambda_a).max()
    assert np.abs(state.solved[0].lambda_a - judge.lambda_a).max() < 0.03 * relieved
