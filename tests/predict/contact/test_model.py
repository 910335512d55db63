"""A learned robot among obstacles as a model: its rows, its derivatives, and what control finds with it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.forces import put

from cfem.condensed.strokes import ridge_of
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.obstacle import Box, Plane, Sphere
from cfem.contact.prescribed_motion import ActuatedRobot, Translation
from cfem.control.search.goal_search import Iterate, SearchSettings, SearchStatus, search_goal
from cfem.control.search.inverse import Aim, Limits
from cfem.core.errors import NumericalError
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.plant.touch_plant import TouchPlant
from cfem.predict.contact.error import ContactBounds
from cfem.predict.contact.forces.load_kernel import estimated_error
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.model import ContactModel
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import contact_step
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

DELTA = np.array([3.0])
UP = np.array([[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])


@pytest.fixture(scope="module")
def patched(patched_bar):
    return patched_bar


@pytest.fixture
def table(patched):
    """A ceiling that the bar's end, which rises as the cable is pulled, meets before DELTA."""
    tops = [patched.patches.mean(patched.model.shape(one))[:, 2].max() for one in (0.3 * DELTA, DELTA)]
    assert tops[1] > tops[0] + 1.0
    return Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, tops[0]]))


def test_rows_are_the_effectors_then_forces_then_distances(patched, table):
    far = Sphere(3.0, t=np.array([30.0, 40.0, 0.0]))
    world = ContactModel(patched, {"table": table}, ("table",), {"far": far})
    assert world.rows.effectors[-2:] == ("table.force", "far.distance")
    state = world.at_displacement(DELTA)
    skin = patched.model.skin
    apart = nearest_of_surface(patched.model.shape(DELTA), skin.triangles, far).distance
    assert state.delta_e[-1] == pytest.approx(apart, abs=1e-9)
    assert state.delta_e[-2] == pytest.approx(world.touched(DELTA).between(0, 1), rel=1e-9)


def test_derivatives_are_those_of_whole_contact_states(patched, table):
    world = ContactModel(patched, {"table": table}, ("table",))
    here, h = world.at_displacement(DELTA), 0.01
    ahead, behind = (world.at_displacement(DELTA + step) for step in (h, -h))
    slope = (ahead.delta_e - behind.delta_e) / (2 * h)
    assert here.effector_jacobian[:, 0] == pytest.approx(slope, rel=1e-3, abs=1e-6)
    K = (ahead.lambda_a - behind.lambda_a) / (2 * h)
    assert 1 / here.W_aa[0, 0] == pytest.approx(K[0], rel=1e-3)
    free = patched.model.at_displacement(DELTA)
    assert 1 / here.W_aa[0, 0] > 1.01 / free.W_aa[0, 0]  # the ceiling stiffens the cable
    assert here.delta_a == pytest.approx(DELTA) and here.lambda_a > free.lambda_a


def test_derivatives_among_soft_robots_are_those_of_ways_from_rest(patched):
    """What has come to touch within the last step slips from where it touched, in the differences too."""
    over = np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 16.0])
    bent = 0.1 * np.abs(patched.model.reach).max() * np.ones((2, 1))
    twin = PlacedModel(patched, *over), ActuatedRobot(patched.model, bent, None, *over)
    world = ContactModel(patched, {}, ("twin",), mu=0.3, others={"twin": twin})
    at, h = np.array([1.25]), 0.01
    here, ahead, behind = (world.at_displacement(at + step) for step in (0.0, h, -h))
    assert here.delta_e[-1] > 0.005
    slope = (ahead.delta_e - behind.delta_e) / (2 * h)
    assert here.effector_jacobian[-1, 0] == pytest.approx(slope[-1], rel=1e-2)


def test_another_robot_lets_its_cable_go_and_the_derivatives_know_it(patched):
    """It stands above, its cable drawn in by 0.05 mm, and is lifted. The robot of the plan holds its own."""
    over, bent = (np.eye(3), np.array([0.0, 0.0, 16.0])), np.full((2, 1), 0.05)
    derivatives = []
    for unilateral in (None, np.ones(1, dtype=bool)):
        twin = PlacedModel(patched, *over, False, unilateral), ActuatedRobot(patched.model, bent, None, *over)
        world = ContactModel(patched, {}, ("twin",), mu=0.3, others={"twin": twin})
        at, h = np.array([2.2]), 0.01
        here, ahead, behind = (world.at_displacement(at + step) for step in (0.0, h, -h))
        met = world.touched(at)
        assert (met.lambda_a[1][0] == 0.0) == (met.deltas[1][0] > 0.05) == (unilateral is not None)
        slope = (ahead.delta_e - behind.delta_e) / (2 * h)
        assert here.effector_jacobian[-1, 0] == pytest.approx(slope[-1], rel=1e-2)
        derivatives.append(slope[-1])
    assert derivatives[1] < 0.9 * derivatives[0]  # it yields more


def test_what_comes_and_lifts_the_robot_makes_its_cable_slack_until_it_goes(patched, bar):
    """As in finite elements; a plan from there holds the cable, and begins where it is."""
    robot, delta = build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml")), np.array([0.3])
    places = patched.patches.mean(patched.model.shape(delta))
    below = places[np.argmin(places[:, 2] - places[:, 0] / 10)] - [0, 0, 8.5]
    ball = Translation(Sphere(8.0, t=below), np.array([[0.0, 0, 0], [0, 0, 2.5], [0, 0, 0.1]]))
    given = {"ball": ball.at(0.0)}, ("ball",)
    world = ContactModel(patched, *given, mu=0.3, courses={"ball": ball}, unilateral=robot.unilateral)
    skin = patched.model.skin
    plant = TouchPlant(
        SkinnedRobot(robot, skin.nodes, skin.triangles, patched.patches), *given, (), 0.3, {"ball": ball}
    )
    world.settle(delta)
    plant.step(delta)
    for share, slack in ((0.5, True), (1.0, False)):
        world.pass_to(share)
        plant.pass_to(share)
        (solved,) = plant.met.solved
        assert (world.before.lambda_a[0][0] == 0.0) == solved.slack[0] == slack
        assert world.before.deltas[0] == pytest.approx(solved.delta_a, abs=0.01)
        force = world.before.between(0, 1)
        assert force == pytest.approx(plant.step(delta).x_e[-1], rel=0.03, abs=1e-12)
        here = world.at_displacement(world.before.deltas[0])
        assert here.delta_e[-1] == pytest.approx(force, rel=1e-3) if force else here.delta_e[-1] < 0


def test_a_step_in_which_a_patch_begins_too_deep_is_taken_in_halves(patched, monkeypatch):
    """A plate comes edge first, by 1 mm at once: its edge pushes the patch before it, as in short steps. So it does
    where the plate stands and the bar comes to it."""
    monkeypatch.setattr("cfem.predict.contact.model.LONGEST", 1.0)
    places = patched.patches.mean(patched.model.shape(DELTA))
    top = places[np.argmax(places[:, 2])]
    plate = Box(np.array([3.0, 0.5, 3.0]), t=top + [0, 0.1, 2.0])
    assert contact_step(patched, DELTA, [plate]).deep
    comes = Translation(replace(plate, t=plate.t + [0, 0, 1.1]), np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -1.1]]))
    moving = ContactModel(patched, {"plate": plate}, courses={"plate": comes}).standing(0.0)
    moving.settle(DELTA)
    moving.pass_to(1.0)
    standing = ContactModel(patched, {"plate": plate})
    standing.settle(0.5 * DELTA)
    assert not standing.before.forces.any()
    for state in (moving.before, standing.touched(DELTA)):
        assert state.trusted
        assert np.abs(state.push).max(axis=0).argmax() == 2


def test_the_force_is_continuous_where_contact_begins(patched, table):
    """Before it a negative one says how far the obstacle is."""
    world = ContactModel(patched, {"table": table}, ("table",))
    forces = np.array([world.at_displacement(np.array([s])).delta_e[-1] for s in np.linspace(0.5, 1.5, 41)])
    assert forces[0] < 0 < forces[-1] and (np.diff(forces) > 0).all()
    assert np.diff(forces).max() < 0.2 * np.ptp(forces)


def test_a_goal_of_force_is_reached_by_the_inverse_step(patched, table):
    world = ContactModel(patched, {"table": table}, ("table",))
    limits = Limits(np.array([[0.0, np.inf]]), patched.model.reach)
    wanted = world.at_displacement(DELTA).delta_e[-1]
    weights, places = np.array([0.0, 0, 0, 1 / world.stiffness]), np.array([True, True, True, False])
    aim = Aim(np.array([0.0, 0, 0, wanted]), weights, ridge_of(1e-10, patched.model.reach, 60.0), places=places)
    found = search_goal(world, aim, limits, Iterate.at(world.at_displacement(np.zeros(1))), SearchSettings(step=1.0))
    assert found.status is SearchStatus.CONVERGED
    assert found.delta_a == pytest.approx(DELTA, abs=1e-3) and found.delta_e[-1] == pytest.approx(wanted, rel=1e-3)
    assert found.distance == 0.0  # no place is asked for


def test_a_distance_to_be_kept_bounds_the_inverse_step(patched, table):
    """The goal lies beyond: the robot stops at that distance, and comes to the goal without the bound."""
    world = ContactModel(patched, {}, (), {"table": table})
    goal = np.append(patched.model.at_displacement(DELTA).delta_e, 0.0)
    aim = Aim(goal, np.array([1.0, 1, 1, 0]), ridge_of(1e-10, patched.model.reach, 60.0))
    start = Iterate.at(world.at_displacement(np.zeros(1)))
    forces, nothing = np.array([[0.0, np.inf]]), [-np.inf, np.inf]
    for bound, kept in ((0.5, True), (-np.inf, False)):
        bounds = np.array([nothing, nothing, nothing, [bound, np.inf]])
        found = search_goal(world, aim, Limits(forces, patched.model.reach, bounds), start, SearchSettings(step=1.0))
        assert found.status is SearchStatus.CONVERGED
        assert (found.delta_e[-1] == pytest.approx(0.5, abs=1e-4)) == kept
        assert (found.distance < 1e-3) != kept


def test_friction_remembers_where_the_robot_stands(patched, table):
    """On the way back from a settled state friction acts against the motion: another force of the cable."""
    forth, back = (ContactModel(patched, {"table": table}, mu=0.8) for _ in range(2))
    back.settle(DELTA + 0.5)
    assert abs(forth.at_displacement(DELTA).lambda_a[0] - back.at_displacement(DELTA).lambda_a[0]) > 1e-5
    smooth = ContactModel(patched, {"table": table})
    before = smooth.at_displacement(DELTA).lambda_a[0]
    smooth.settle(DELTA + 0.5)
    assert smooth.at_displacement(DELTA).lambda_a[0] == pytest.approx(before, rel=1e-9)


def test_a_load_that_bends_the_robot_beyond_its_order_is_outside(patched, table):
    """The second order of the load's motion is what its symmetric difference leaves, and grows in proportion to it."""
    delta = np.array([1.25])
    world = ContactModel(patched, {"table": table}, ("table",))
    world.settle(delta)  # from there no round goes farther
    state, touched = world.at_displacement(delta), world.touched(delta)
    held, size = LoadedRobots.of(patched, delta), 1e-3
    ends = []
    for share in (size, -size):
        put(held, touched.pairs.points, share * touched.push)
        ends.append(held.rows[0] - held.held[0].rows)
    share = np.linalg.norm(ends[0] + ends[1]) / np.linalg.norm(ends[0] - ends[1])
    assert (
        estimated_error(share / size, patched.missing) == pytest.approx(touched.error, rel=1e-4) and touched.error > 0
    )
    assert world.inside(state) and not world.inside(replace(state, trusted=False))


def test_no_contact_state_is_an_error(patched, table, monkeypatch):
    monkeypatch.setattr("cfem.predict.contact.surface.surface_model.SurfaceModel.most", 0)
    with pytest.raises(NumericalError, match="patches touch"):
        ContactModel(patched, {"table": table}).at_displacement(DELTA)


@pytest.mark.parametrize(("alone", "tip"), [(None, 0.2), (0.3, 0.5)])
def test_the_error_of_the_tip_in_contact_adds_to_that_of_the_robot_alone(alone, tip):
    model = SimpleNamespace(error=lambda _: None if alone is None else SimpleNamespace(tip=alone))
    world = SimpleNamespace(
        patched=SimpleNamespace(model=model),
        stated=(SimpleNamespace(probability=0.95), SimpleNamespace(probability=0.9)),
    )
    rows = SimpleNamespace(n=5, n_a=2)
    stated = ContactModel.error(world, SimpleNamespace(bounds=ContactBounds(1.0, 0.2), rows=rows))
    assert stated.tip == pytest.approx(tip) and stated.probability == 0.9
    assert np.isnan(stated.actuators).all()
    assert ContactModel.error(world, SimpleNamespace(rows=rows)) is None


def test_friction_is_followed_along_a_step(patched, bar, monkeypatch):
    """A wall that presses moves aside, and then at a right angle, in two long steps: friction turns on the way, in the
    learned robot and in finite elements, as it does in 32 times as many steps of one part."""
    robot = build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))
    places = patched.patches.mean(patched.model.shape(0.1 * DELTA))
    turn = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    wall = Plane(R=turn, t=places[np.argmax(places[:, 1])] - [0, 1.0, 0])
    way = Translation(wall, np.array([[0.0, 0, 0], [0.4, 0, 0], [0.4, 0, 0.4]]))
    skin, given = patched.model.skin, ({"wall": wall}, ("wall",))

    def answers(steps, parts):
        """Force of the wall, N, and tip, mm from rest: of the learned robot, and of finite elements."""
        world = ContactModel(patched, *given, mu=0.5, courses={"wall": way}, parts=parts)
        surface = SkinnedRobot(robot, skin.nodes, skin.triangles, patched.patches)
        plant = TouchPlant(surface, *given, (), 0.5, {"wall": way}, parts=parts)
        world.settle(0.1 * DELTA)
        plant.step(0.1 * DELTA)
        for share in np.arange(1, 2 * steps + 1) / (2 * steps):
            world.pass_to(share)
            plant.pass_to(share)
        felt = plant.step(0.1 * DELTA).x_e - np.concatenate([robot.rest_e, [0.0]])
        return world.at_displacement(0.1 * DELTA).delta_e, felt

    monkeypatch.setattr("cfem.predict.contact.model.LONGEST", 1.0)
    monkeypatch.setattr("cfem.plant.touch_plant.LONGEST", 1.0)
    shorter, whole, parts = answers(32, 1), answers(1, 1), answers(1, 16)
    for truth, at_once, followed in zip(shorter, whole, parts, strict=True):
        missed, left = (np.abs(answer - truth) for answer in (at_once, followed))
        assert missed[-1] > 0.005 * truth[-1]
        assert left[-1] < missed[-1] / 5
        assert np.linalg.norm(left[:3]) < np.linalg.norm(missed[:3]) / 10
