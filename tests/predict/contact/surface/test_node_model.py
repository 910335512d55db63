"""A learned robot that touches with every node of its surface, against finite elements that do."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.fast_cases import fast_are
from support.forces import compliance_of, put

from cfem.constraint.surface import outer_surface
from cfem.constraint.surface_points import at_nodes
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.obstacle import Box, Plane, Sphere
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.surface.triangles import area_vectors
from cfem.core.errors import InputError
from cfem.equilibrium.contact.node_compliance import NodeResponse
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.predict.contact.forces import loaded_robots
from cfem.predict.contact.forces.held_robot import HeldRobot
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import ContactScene, contact_step
from cfem.predict.contact.surface import node_model
from cfem.predict.contact.surface.node_model import NodeModel, _add_local, _dents

DELTA = np.array([2.0])


@pytest.fixture(scope="module")
def skinned(robot):
    surface = outer_surface(robot.X, robot.body.mesh.facets)
    points = at_nodes(robot.X, robot.body.mesh.facets, surface)
    return SkinnedRobot(robot, surface.nodes, surface.triangles, points, itself=False)


def test_what_is_near_adds_the_compliance_of_its_pairs():
    """Against the blocks L_ij and L_ij^T written out, of three of five nodes."""
    rng = np.random.default_rng(2)
    pairs = np.array([[0, 0], [0, 2], [0, 4], [1, 1], [2, 2], [2, 4], [3, 3], [4, 4]])
    first = np.searchsorted(pairs[:, 0], np.arange(6))
    left = rng.normal(size=(2, len(pairs), 3, 3)).astype(np.float32)
    linear, points = np.array([1.0, 0.3]), np.array([4, 0, 2])
    total = np.zeros((9, 9))
    _add_local(total, points, linear, first, pairs[:, 1], left)
    expected = np.zeros((3, 3, 3, 3))
    for pair, (low, high) in enumerate(pairs):
        i, j = (list(points).index(node) if node in points else -1 for node in (low, high))
        if min(i, j) >= 0:
            block = np.tensordot(linear, left[:, pair], axes=1)
            expected[i, :, j] += block
            if i != j:
                expected[j, :, i] += block.T
    np.testing.assert_allclose(total, expected.reshape(9, 9), atol=1e-14)


def test_dents_of_nodes_that_touch_turn_with_all_three():
    """Against the products written out, of three of five nodes."""
    rng = np.random.default_rng(2)
    triples = np.array([[0, 0, 0], [0, 0, 2], [0, 2, 4], [0, 3, 4], [1, 1, 1], [2, 4, 4], [4, 4, 4]])
    first = np.searchsorted(triples[:, 0], np.arange(6))
    dented = rng.normal(size=(len(triples), 3, 3, 3)).astype(np.float32)
    points, R = np.array([0, 2, 4]), Rotation.random(3, rng).as_matrix()
    chosen, turned = _dents(points, R, first, triples, dented)
    expected = triples[[0, 1, 2, 5, 6]] // 2
    np.testing.assert_array_equal(chosen, expected)
    for (i, j, k), each, at_rest in zip(expected, turned, dented[[0, 1, 2, 5, 6]], strict=True):
        np.testing.assert_allclose(each, np.einsum("ap,bq,cr,pqr", R[i], R[j], R[k], at_rest), atol=1e-14)


DOWN = np.array([0.0, 0.0, -1.0])


def obstacle_above(model, kind):
    """An obstacle that just touches the bar from above, near its free end."""
    x = model.shape(DELTA)
    above = x[(x[:, 0] > x[:, 0].max() - 14.0) & (x[:, 2] > x[:, 2].max() - 14.0)]
    t = above.mean(axis=0) + np.array([0.0, 0.0, 40.0])
    turn = np.array([[1.0, 0, 0], [0, np.sqrt(0.5), -np.sqrt(0.5)], [0, np.sqrt(0.5), np.sqrt(0.5)]])
    obstacle = {
        "ball": Sphere(6.0, t=t),
        "plane": Plane(R=np.diag([1.0, -1.0, -1.0]), t=t),
        "edge": Box(np.array([5.0, 5.0, 5.0]), R=turn, t=t + [0, 0.2, 0]),  # beside the nodes in the middle
    }[kind]
    for _ in range(200):  # down until it is there: no step is longer than the distance
        obstacle = replace(obstacle, t=obstacle.t + obstacle.distance(x).min() * DOWN)
    return obstacle


@pytest.mark.parametrize(
    "kind, mu", fast_are([("ball", 0.0), ("plane", 0.5), ("edge", 0.5)], product(["ball", "plane", "edge"], [0.0, 0.5]))
)
def test_it_presses_as_finite_elements_do_that_touch_at_every_node(nodes, robot, skinned, kind, mu):
    obstacle, found = obstacle_above(nodes.model, kind), None
    away = replace(obstacle, t=obstacle.t - 5.0 * DOWN)
    truth = SurfaceScene([skinned], ObstacleSet((away,)), mu).go([DELTA])
    for depth in (0.05, 0.3, 0.6):
        here = replace(obstacle, t=obstacle.t + depth * DOWN)
        found = contact_step(nodes, DELTA, [here], mu=mu, before=found, unilateral=robot.unilateral)
        truth = SurfaceScene([skinned], ObstacleSet((here,)), mu).step([DELTA], truth)
    assert found.converged and truth.converged and found.trusted
    force, exact = found.forces.sum(axis=0), truth.forces.sum(axis=0)
    assert np.linalg.norm(exact) > 1e-3
    assert np.linalg.norm(force - exact) < (0.05 if mu else 0.02) * np.linalg.norm(exact)
    assert found.delta_e[0] == pytest.approx(truth.solved[0].delta_e, abs=0.02)
    assert here.distance(found.places).min() > -1e-6 * nodes.model.length  # no node is in the obstacle


def test_an_edge_that_comes_straight_at_a_node_presses_as_in_finite_elements_and_as_from_aside(nodes, skinned):
    """A node alone would be pushed to one side of the edge or the other. The edge presses the edges of the mesh that it
    crosses, so that there is one state, which hardly changes where the edge comes beside the node."""
    x, edge = nodes.model.shape(DELTA), obstacle_above(nodes.model, "edge")
    node = np.argmin(edge.distance(x))

    def at(depth, aside=0.0):
        return replace(edge, t=x[node] + (depth - 5.0 * np.sqrt(2)) * DOWN + [0, aside, 0])

    forces = []
    for aside in (0.0, 0.05, -0.05):
        found, truth = None, SurfaceScene([skinned], ObstacleSet((at(-1.0),))).go([DELTA])
        for obstacle in (at(0.02, aside), at(0.2, aside), at(0.4, aside)):
            found = contact_step(nodes, DELTA, [obstacle], before=found)
            truth = SurfaceScene([skinned], ObstacleSet((obstacle,))).step([DELTA], truth)
        assert found.converged and truth.converged and found.trusted
        forces.append(truth.forces.sum(axis=0))
        off = np.linalg.norm(found.forces.sum(axis=0) - forces[-1])
        assert off < 0.02 * np.linalg.norm(forces[-1])
        depth = -nearest_of_surface(found.places, nodes.model.skin.triangles, obstacle, 1e-4).distance
        assert abs(depth) < 1e-3
    for force in forces[1:]:
        assert np.linalg.norm(force - forces[0]) < 0.05 * np.linalg.norm(forces[0])


def test_an_edge_that_leaps_into_the_surface_is_met_or_the_answer_is_not_known(nodes):
    """In one step from where nothing touches. Beyond what an edge may have come in, it would press nothing."""
    x, edge = nodes.model.shape(DELTA), obstacle_above(nodes.model, "edge")
    node, met = np.argmin(edge.distance(x)), []
    for depth in (0.5, 1.0, 2.0, 3.0, 4.0, 5.0):
        here = replace(edge, t=x[node] + (depth - 5.0 * np.sqrt(2)) * DOWN)
        state = contact_step(nodes, DELTA, [here])
        within = -nearest_of_surface(state.places, nodes.model.skin.triangles, here, 1e-4).distance
        met.append(state.converged and state.trusted)
        assert within < 1e-3 or not met[-1]
    assert met[0] and not met[-1]


def test_the_compliance_of_nodes_is_symmetric_and_positive(nodes):
    some = np.flatnonzero(~nodes.held_still)[:40]
    C = compliance_of(LoadedRobots.of(nodes, DELTA), some)
    assert np.array_equal(C, C.T) or np.abs(C - C.T).max() < 1e-12 * np.abs(C).max()
    assert np.linalg.eigvalsh(C).min() > -1e-12 * np.abs(C).max()


def test_the_compliance_is_that_of_finite_elements_at_their_states(nodes, monkeypatch):
    """R_i (Phi_i K Phi_j^T + L_ij) R_j^T written out, of few nodes, whose series are found once, and as of many."""
    nodes, found, series = replace(nodes), [], NodeModel._series  # of which nothing is kept
    fe, some = nodes.by_fe, np.flatnonzero(~nodes.held_still)[:40:4]
    monkeypatch.setattr(NodeModel, "_series", lambda *given: found.append(given) or series(*given))
    modes = fe.modes.reshape(len(nodes.patches), 3, -1)[some].astype(float)
    for few in (len(some), 0):
        monkeypatch.setattr(node_model, "FEW", few)
        for left, number in zip(fe.left, fe.local, strict=True):
            held = HeldRobot(nodes, fe.states[number], None)
            expected = np.einsum("iap,pq,jbq->iajb", modes, fe.by_modes[number], modes)
            for (low, high), L in zip(fe.pairs, left, strict=True):
                i, j = np.flatnonzero(some == low), np.flatnonzero(some == high)
                expected[i, :, j] += L
                if low != high:
                    expected[j, :, i] += L.T
            R = nodes.turns(held.rows, some)
            expected = np.einsum("iap,ipjq,jbq->iajb", R, expected, R).reshape(3 * len(some), -1)
            U, local, total, *_ = nodes.compliance(some, held.rows, held.C_ss, held.basis)
            np.testing.assert_allclose(total, expected, atol=1e-6 * np.abs(expected).max())  # of single precision
            np.testing.assert_allclose(total - local, U @ held.C_ss @ U.T, atol=1e-12 * np.abs(expected).max())
    assert len(found) == 3


def test_a_robot_that_touches_nothing_waits_while_another_touches(nodes):
    above = obstacle_above(nodes.model, "ball")
    obstacle = replace(above, t=above.t + 0.2 * DOWN)
    here, there = (PlacedModel(nodes, t=t, itself=False) for t in (np.zeros(3), np.array([0.0, 500.0, 0.0])))
    alone = contact_step(nodes, DELTA, [obstacle])
    both = ContactScene([here, there], ObstacleSet((obstacle,)), meet=False).step([DELTA, DELTA], None)
    assert alone.forces.any() and both.forces[: len(alone.forces)] == pytest.approx(alone.forces, abs=1e-12)
    assert not both.answers.work[-3:].any() and not both.forces[len(alone.forces) :].any()


def test_a_response_of_other_nodes_is_refused(nodes):
    fewer = NodeResponse(**{**vars(nodes.by_fe), "modes": nodes.by_fe.modes[:-3]})
    with pytest.raises(InputError, match="nodes"):
        NodeModel(nodes.model, nodes.patches, fewer)


@pytest.mark.parametrize(("x", "left"), [(10.0, 0.4), (15.0, 0.6)])
def test_forces_on_neighbours_dent_the_surface_as_finite_elements_say(nodes, skinned, x, left):
    """The second order of the places under forces, as differences of states with them and against them; farther from
    where the bar is held it bends by more than its four modes tell."""
    skin, normals = nodes.model.skin, area_vectors(nodes.model.skin.rest, nodes.model.skin.triangles)
    some = np.sort(np.argsort(np.linalg.norm(skin.rest - [x, 0.0, 5.0], axis=1))[:3])
    forces = -0.1 * normals[some] / np.linalg.norm(normals[some], axis=1, keepdims=True) * [[1.0], [0.6], [1.4]]
    loaded, places, start = LoadedRobots.of(nodes, DELTA), [], None
    without = LoadedRobots.of(replace(nodes, by_fe=replace(nodes.by_fe, dented=0 * nodes.by_fe.dented)), DELTA)
    for share in (0.0, 1.0, -1.0):
        nodal = np.zeros_like(skinned.robot.X)
        nodal[skinned.nodes[some]] = share * forces
        solved = solve(skinned.problem.under(nodal), displacement(DELTA), start, slack=False)
        start, each = solved.state, [skinned.surface(solved.state.x)[some]]
        for learned in (loaded, without):
            put(learned, some, share * forces)
            each.append(learned.places[some])
        places.append(each)
    exact, by_dents, by_modes = np.array(places[1]) + np.array(places[2]) - 2 * np.array(places[0])
    assert np.linalg.norm(by_modes - exact) > 0.9 * np.linalg.norm(exact)
    assert np.linalg.norm(by_dents - exact) < left * np.linalg.norm(by_modes - exact)


def test_a_step_that_changes_little_finds_the_compliance_once_and_what_forces_do_twice(nodes, monkeypatch):
    """Under the forces of the state before, and under those of its only round."""
    obstacle, counts = obstacle_above(nodes.model, "plane"), {"compliance": 0, "load_robots": 0}
    here = replace(obstacle, t=obstacle.t + 0.3 * DOWN)
    before = contact_step(nodes, DELTA, [here], before=contact_step(nodes, DELTA, [here]))

    def counted(owner, name, function):
        def call(*given):
            counts[name] += 1
            return function(*given)

        monkeypatch.setattr(owner, name, call)

    counted(NodeModel, "compliance", NodeModel.compliance)
    counted(loaded_robots, "load_robots", loaded_robots.load_robots)
    found = contact_step(nodes, DELTA * (1 + 1e-6), [here], before=before)
    assert found.converged and found.iterations == 1 and len(found.known) > 1
    assert counts == {"compliance": 1, "load_robots": 2}


def test_the_compliance_under_forces_is_the_derivative_of_the_places(nodes):
    some = np.sort(np.argsort(np.linalg.norm(nodes.model.skin.rest - [15.0, 0.0, 5.0], axis=1))[:3])
    forces, step = 0.1 * np.random.default_rng(1).normal(size=(3, 3)), 1e-5
    loaded, each = LoadedRobots.of(nodes, DELTA), []
    put(loaded, some, forces)
    compliance, dents = loaded.compliance(under_forces=True), loaded.places[some]
    for unit in np.eye(9).reshape(9, 3, 3):
        sides = []
        for way in (step, -step):
            put(loaded, some, forces + way * unit)
            sides.append(loaded.places[some].ravel())
        each.append((sides[0] - sides[1]) / (2 * step))
    np.testing.assert_allclose(compliance, np.column_stack(each), atol=1e-6 * np.abs(compliance).max())
    without = LoadedRobots.of(replace(nodes, by_fe=replace(nodes.by_fe, dented=0 * nodes.by_fe.dented)), DELTA)
    put(without, some, forces)
    assert np.abs(dents - without.places[some]).max() > 1e-4


@pytest.mark.parametrize("mu", fast_are({0.0}, [0.0, 0.3]))
def test_two_that_press_each_other_at_their_nodes_do_as_finite_elements_do(nodes, skinned, mu):
    """A bar and its twin, upside down and 6 mm above it."""
    over, deltas = (np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0])), [np.array([1.0]), np.array([0.9])]
    learned = ContactScene([PlacedModel(nodes, itself=False), PlacedModel(nodes, *over, itself=False)], mu=mu)
    state = learned.go(deltas)
    truth = SurfaceScene([skinned, replace(skinned, R=over[0], t=over[1])], mu=mu).go(deltas)
    assert state.converged and truth.converged and truth.pressed > 0.02
    assert state.pressed == pytest.approx(truth.pressed, rel=0.02)
    for delta, tip, solved in zip(deltas, state.delta_e, truth.solved, strict=True):
        moved = solved.delta_e - nodes.model.at_displacement(delta).delta_e
        assert np.linalg.norm(tip - solved.delta_e) < 0.02 * np.linalg.norm(moved)
