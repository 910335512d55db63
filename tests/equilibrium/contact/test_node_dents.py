"""How forces on neighbouring nodes change what they yield, against states of finite elements with and against them."""

from dataclasses import replace

import numpy as np
import pytest

from cfem.condensed import Rows
from cfem.constraint.surface import outer_surface
from cfem.equilibrium.contact.node_dents import NodeDents
from cfem.equilibrium.contact.patch_compliance import solved_at
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

SIZE = 2e-3  # N


@pytest.fixture(scope="module")
def robot(bar):
    """The bar without its cable, bent by a load: what elements alone tell."""
    robot = build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))
    loads = np.where(robot.X[:, :1] == robot.X[:, 0].max(), [0.0, 2e-4, -1e-3], 0.0)
    none = np.zeros((0, 2))
    rows = Rows(robot.rows.effectors, ())
    return replace(robot, actuators=(), rows=rows, reach=none, unilateral=none[:, 0] > 0, loads=loads)


@pytest.fixture(scope="module")
def near(robot):
    """Three surface nodes in the middle of the bar's upper side."""
    nodes = outer_surface(robot.X, robot.body.mesh.facets).nodes
    return np.sort(nodes[np.argsort(np.linalg.norm(robot.X[nodes] - [30.0, 0.0, 5.0], axis=1))[:3]])


@pytest.fixture(scope="module")
def pushed(robot, near):
    """The state, motions (n, 3, 9) mm/N of the mesh by unit forces on the three nodes, and the problem."""
    problem = Problem(robot)
    linear = solved_at(problem, np.zeros(0)).linear
    nodal = np.zeros((*robot.X.shape, 9))
    nodal[near] = np.eye(9).reshape(3, 3, 9)
    motions = linear.factor.solve(problem.kinematics.reduce(linear.at.x, nodal))
    return linear, problem.kinematics.spread(linear.at.x, motions), problem


def symmetric(triples, changes):
    """D (9, 9, 9) of three nodes."""
    D = np.zeros((3, 3, 3, 3, 3, 3))
    for (i, j, k), change in zip(triples, changes, strict=True):
        for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
            p, q, r = np.array([i, j, k])[list(order)]
            D[p, :, q, :, r] = change.transpose(order)
    return D.reshape(9, 9, 9)


def test_with_all_elements_it_is_the_second_order_of_finite_elements(robot, near, pushed):
    linear, motions, problem = pushed
    dents = NodeDents(problem, near, 1e3, linear.at.x, np.zeros((*robot.X.shape, 1)))
    dents.take(0, motions)
    D = symmetric(*dents.changes(np.zeros((3, 1, 3))))
    f = np.array([0.2, 0.1, -1.0, 0.0, 0.3, -0.6, -0.4, 0.0, -1.4])

    def places(share):
        nodal = np.zeros_like(robot.X)
        nodal[near] = share * f.reshape(3, 3)
        return solved_at(problem.under(nodal), np.zeros(0)).state.x[near].ravel()

    h = SIZE
    second = (16 * (places(h) + places(-h)) - places(2 * h) - places(-2 * h) - 30 * places(0.0)) / (12 * h**2)
    by_dents = np.einsum("ijk,j,k->i", D, f, f)
    assert by_dents == pytest.approx(second, abs=2e-3 * np.abs(second).max())


def test_what_two_rotations_that_the_modes_tell_do_to_a_node_is_left_to_the_modes(robot, near, pushed):
    """The second and third node make rotations alone."""
    linear, motions, problem = pushed
    turns = np.cross(np.eye(3)[None], (linear.at.x - linear.at.x[near].mean(axis=0))[:, :, None], axis=1)
    loads = np.random.default_rng(0).normal(size=(3, 3, 3)) * [[[0.0]], [[1.0]], [[1.0]]]
    motions, told = np.concatenate([motions[:, :, :3], turns @ loads[1], turns @ loads[2]], axis=2), []
    for smooth in (turns, 0 * turns):
        dents = NodeDents(problem, near, 12.0, linear.at.x, smooth)
        dents.take(0, motions)
        triples, changes = dents.changes(loads)
        told.append(np.abs(changes).max(axis=(1, 2, 3)))
    once = (triples == 0).sum(axis=1) == 1
    assert once.sum() == 3
    assert told[0][once] == pytest.approx(0.0, abs=1e-6 * told[1][once].min())
    assert told[0][~once].max() > 1e-3 * told[1][once].max()  # dents that turn with the surface stay
