"""The weight of a soft robot whose base turns, against finite elements under gravity, and against energy."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from support.obstacle_step import obstacle_step

from cfem.contact.obstacle import Plane
from cfem.core.errors import InputError
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.mujoco import World
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

G = 9.81
DELTA = np.array([2.0])
GEOM = '<geom size="0.01" mass="1" contype="0" conaffinity="0"/>'
BASE = f'<body><joint name="base" axis="1 0 0"/>{GEOM}<site name="bar"/></body>'


PLATE = '<body><geom name="plate" type="box" size="0.02 0.002 0.02" pos="0.045 0.0078 0" mass="0"/></body></body>'


def world_of(robot, base=BASE, **more):
    xml = f'<mujoco><option timestep="0.02"/><worldbody>{base}</worldbody></mujoco>'
    return World(xml, {"bar": robot}, **more)


def turned(world, angle):
    """The state at an angle of the base, degrees, after steps from 0."""
    for share in np.linspace(0.0, 1.0, 10):
        world.data.qpos[0], world.data.qvel[:] = np.radians(share * angle), 0.0
        state = world.step({"bar": DELTA})
    return state


def fe_under(scene, gravity):
    """The bar of finite elements under gravity, m/s^2 in its own frame."""
    spec = yaml.safe_load(scene.read_text()) | {"gravity": {"acceleration": {"m/s^2": gravity}}}
    path = scene.with_name("under.yaml")
    path.write_text(yaml.safe_dump(spec))
    return build_robot(*load_scene_and_mesh(path))


def at_rest(robot):
    return solve(Problem(robot), displacement(DELTA), slack=False)


@pytest.mark.parametrize(("angle", "gravity"), [(90, [0.0, -G, 0.0]), (180, [0.0, 0.0, G])])
def test_a_bar_whose_base_turns_sags_as_finite_elements_do(heavy_bar, heavy_scene, angle, gravity):
    """Its effectors, its surface and the force of its cable."""
    world, surface = world_of(heavy_bar), heavy_bar.surface
    state = turned(world, angle)
    light, heavy = (at_rest(fe_under(heavy_scene, each)) for each in ([0.0] * 3, gravity))
    sag = np.linalg.norm((heavy.delta_e - light.delta_e)[:3])
    assert sag > 0.9
    assert np.linalg.norm((state.delta_e[0] - heavy.delta_e)[:3]) < 0.001 * sag
    places = surface.patches.mean(heavy.state.x[surface.model.skin.nodes])
    assert np.linalg.norm(world.places @ rotation(angle) - places, axis=1).max() < 0.01 * sag
    assert state.lambda_a[0] == pytest.approx(heavy.condensed.lam[:1], rel=1e-5)


def test_a_bar_that_its_weight_lays_on_a_plate_presses_it_as_finite_elements_do(heavy_bar, heavy_scene):
    """Gravity along y of the bar, and a plate before it that bears a part of the weight."""
    world = world_of(heavy_bar, BASE.replace("</body>", PLATE), friction=0.0)
    state, patched = turned(world, -90), heavy_bar.surface
    robot, near = fe_under(heavy_scene, [0.0, G, 0.0]), np.flatnonzero(world.places[:, 2] < -5.0)
    plate = Plane(R=np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]]), t=np.array([0.0, 5.8, 0.0]))
    touched = Problem(with_patches(robot, patched.model.skin.nodes, patched.patches, near))
    (solved,) = obstacle_step(touched, displacement(DELTA), [plate] * len(near)).solved
    force = solved.lambda_c.reshape(-1, 3).sum(axis=0)
    assert np.linalg.norm(force) > 0.01
    assert np.linalg.norm(world.force("bar") @ rotation(-90) - force) < 0.01 * np.linalg.norm(force)
    assert state.delta_e[0] == pytest.approx(solved.delta_e, abs=0.01)
    assert state.lambda_a[0] == pytest.approx(solved.state.lam[:1], rel=1e-3)


def rotation(angle):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    return np.array([[1, 0, 0], [0, c, -s], [0, s, c]])


def test_gravity_that_the_samples_had_is_not_counted_twice(heavy_bar):
    there = replace(heavy_bar, weight=replace(heavy_bar.weight, sampled=np.array([0.0, 0.0, -1e3 * G])))
    assert not any(each.any() for each in turned(world_of(there), 0).wrenches)
    assert turned(world_of(there), 90).wrenches[0][3:] == pytest.approx(
        heavy_bar.weight.mass * 1e3 * np.array([0, -G, G])
    )


def test_weight_that_turns_against_what_is_touched_does_work(heavy_bar):
    """A base turns about the bar with a plate beside it, on which the bar comes to lie. Without friction, the work of
    the weight is what contact stores, and comes back."""
    base = BASE.replace('"1 0 0"', '"1 0 0" armature="1000"').replace("<body>", '<body gravcomp="1">')
    world, energies = world_of(heavy_bar, base.replace("</body>", PLATE), friction=0.0), []
    for speed in (-1.5, 1.5):
        world.data.qvel[0] = speed
        for _ in range(50):
            world.step({})
            energies.append(world.energies)
    most = max(energies, key=lambda each: each.stored)
    assert most.stored > 0.005 and most.passed == pytest.approx(0.0, abs=1e-9)
    assert most.commanded == pytest.approx(most.stored, rel=0.01)
    assert energies[-1].stored == 0.0 and abs(energies[-1].commanded) < 1e-6 * most.stored


def test_a_weight_that_the_model_does_not_know_is_refused(heavy_bar):
    heavy = replace(heavy_bar, weight=replace(heavy_bar.weight, mass=20 * heavy_bar.weight.mass))
    with pytest.raises(
        InputError, match=r"the weight of 'bar' bends it so far .* wrong by about .*0\.3 mm are allowed"
    ):
        world_of(heavy)
