"""The FE robot among obstacles as a plant."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.obstacle_step import obstacle_step

from cfem.condensed.patches import cut
from cfem.constraint.surface import outer_surface
from cfem.contact.law.modes import Mode
from cfem.contact.obstacle import Plane, Sphere
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.plant.fem_plant import FemPlant
from cfem.plant.touch_plant import TouchPlant

CEILING = Plane(R=np.diag([1.0, -1.0, -1.0]), t=np.array([0.0, 0.0, 9.0]))


@pytest.fixture(scope="module")
def surface(robot):
    return outer_surface(robot.X, robot.body.mesh.facets)


@pytest.fixture(scope="module")
def patches(surface):
    return cut(surface.rest, surface.weights, 8.0, surface.triangles)


def plant(robot, surface, patches, obstacles, pressed=(), avoided=(), mu=0.0):
    return TouchPlant(SkinnedRobot(robot, surface.nodes, surface.triangles, patches), obstacles, pressed, avoided, mu)


def test_without_obstacles_in_reach_it_is_the_fe_robot(robot, surface, patches):
    far = Sphere(2.0, t=np.array([0.0, 90.0, 0.0]))
    among = plant(robot, surface, patches, {"far": far}, (), ("far",))
    found, free = among.step(np.array([1.0])), FemPlant(robot).step(np.array([1.0]))
    assert found.status == "converged" and found.x_e[:3] == pytest.approx(free.x_e, abs=1e-8)
    assert found.x_e[3] > 60.0 and among.account()["points"] == {"open": 0, "stick": 0, "slip": 0}


def test_it_meets_what_it_comes_to_and_grows_its_contact_points(robot, surface, patches):
    among = plant(robot, surface, patches, {"ceiling": CEILING}, ("ceiling",))
    for pull in (0.5, 1.2, 1.6):
        found = among.step(np.array([pull]))
        assert found.status == "converged"
    assert found.x_e[3] > 1e-3 and among.worst <= 1e-8
    distance = CEILING.distance(patches.mean(among.x[surface.nodes]))
    assert distance.min() > -1e-6 * robot.length
    near = np.flatnonzero((distance < 4.0) & (patches.rest[:, 0] > 20.0))  # the same by all of these from the start
    truth = obstacle_step(
        Problem(with_patches(robot, surface.nodes, patches, near)), displacement([1.6]), [CEILING] * len(near)
    )
    assert truth.converged
    assert found.x_e[:3] == pytest.approx(robot.rest_e + truth.solved[0].delta_e, abs=1e-5)
    assert found.x_e[3] == pytest.approx(-truth.solved[0].lambda_c[2::3].sum(), rel=1e-4)
    assert found.lambda_a == pytest.approx(truth.solved[0].lambda_a, rel=1e-5)


def test_the_way_back_frees_it(robot, surface, patches):
    among = plant(robot, surface, patches, {"ceiling": CEILING}, ("ceiling",))
    pressed, freed = among.step(np.array([1.2])), among.step(np.array([0.2]))
    assert pressed.x_e[3] > 0 and abs(freed.x_e[3]) < 1e-9
    assert freed.x_e[:3] == pytest.approx(FemPlant(robot).step(np.array([0.2])).x_e, abs=1e-6)
    assert set(among.counts[-1]) == {Mode.OPEN.value}


def test_too_many_patches_end_the_way_and_say_so(robot, surface, patches, monkeypatch):
    monkeypatch.setattr("cfem.equilibrium.contact.surfaces.MOST", 0)
    among = plant(robot, surface, patches, {"ceiling": CEILING})
    found = among.step(np.array([3.0]))
    assert "take larger patches" in found.status and among.failures == 1 and np.isfinite(found.x_e).all()


def test_it_takes_displacements_only(robot, surface, patches):
    assert "displacements" in plant(robot, surface, patches, {"ceiling": CEILING}).step(np.array([1.0]), "force").status


def test_a_surface_that_passes_an_obstacle_between_its_patches_is_called_poor(robot, surface, patches):
    """Patches of 8 mm on faces of 10 mm: their places, which touch, are within the body, and a small ball goes by."""
    ball = Sphere(3.0, t=np.array([45.0, 0.0, 9.0]))
    among = plant(robot, surface, patches, {"ball": ball})
    assert among.step(np.array([1.5])).status == "converged"
    middles = among.x[surface.nodes][surface.triangles].mean(axis=1)  # of triangles: not where it is nearest
    depth, name = among.deepest
    assert name == "ball" and 3.0 > depth > -ball.distance(middles).min() > 0.01 * robot.length
    (judged,) = among.judged(robot.length)
    assert "into ball between its patches" in judged["what"] and "into ball" in among.sentence()
    far = plant(robot, surface, patches, {"far": Sphere(2.0, t=np.array([0.0, 90.0, 0.0]))})
    far.step(np.array([1.5]))
    assert not far.judged(robot.length) and "between patches" not in far.sentence()


class Bent:
    """The course of a robot whose actuator stays where it is."""

    def deltas(self, share):
        return np.array([0.4])


def test_a_surface_that_passes_another_robot_between_its_patches_is_called_poor(robot, surface, patches):
    """The other bar hangs upside down, turned so that it shows its edge: its patches lie beside that."""
    c = np.sqrt(0.5)
    turned, shift = np.array([[1, 0, 0], [0, -c, -c], [0, c, -c]]), np.array([0.0, 0.0, 11.0])
    own = SkinnedRobot(robot, surface.nodes, surface.triangles, patches)
    twin = SkinnedRobot(robot, surface.nodes, surface.triangles, patches, turned, shift, False)
    among = TouchPlant(own, {}, others={"twin": (twin, Bent())})
    assert among.step(np.array([0.8])).status == "converged"
    depth, name = among.deepest
    edge = twin.surface(among.met.solved[1].state.x)
    inside = ClosedSurface(among.x[surface.nodes], surface.triangles).distance(edge)[0].min()
    assert name == "twin" and -inside > 0.01 * robot.length
    assert depth == pytest.approx(-inside, abs=0.5)  # of points of the one in the other, and the other way round
    assert "into twin between its patches" in among.judged(robot.length)[0]["what"]


def test_another_robot_whose_surface_overlaps_itself_has_no_inside_and_is_named(robot, surface, patches, monkeypatch):
    """Its nodes mirrored: all triangles face inwards, as where a body is turned inside out."""
    own = SkinnedRobot(robot, surface.nodes, surface.triangles, patches)
    twin = SkinnedRobot(robot, surface.nodes, surface.triangles, patches, np.eye(3), np.array([0.0, 0.0, 40.0]), False)
    among = TouchPlant(own, {}, others={"twin": (twin, Bent())})
    assert among.step(np.array([0.4])).status == "converged" and not among.unjudged
    monkeypatch.setattr(SkinnedRobot, "surface", lambda self, x: x[self.nodes] * [1, -1, 1])
    assert not among._bodies() and among.unjudged == {"twin"}
    assert "twin overlaps itself" in among.judged(robot.length)[0]["what"]


def test_depth_in_itself_is_looked_for_at_the_patches_that_are_near_others(robot, surface, patches, monkeypatch):
    """Of points 1 and 3 near something, and obstacles behind the patches' numbers; a node is tried with its patch."""
    among, asked, count = plant(robot, surface, patches, {}), [], len(patches)
    monkeypatch.setattr(
        "cfem.plant.touch_plant.depth_in_itself", lambda x, triangles, tried: asked.append((x, tried)) or 0.25
    )
    near = SimpleNamespace(used=np.array([1, 3, count, count + 2]))
    among.met = SimpleNamespace(pairs=near, solved=[SimpleNamespace(state=SimpleNamespace(x=robot.X + 1.0))])
    assert among._depth_in_itself() == 0.25
    ((x, tried),) = asked
    np.testing.assert_allclose(x, robot.X[surface.nodes] + 1.0)
    np.testing.assert_array_equal(tried, [i for i, patch in enumerate(patches.of) if patch in (1, 3)])
