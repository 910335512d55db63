"""A soft robot on a base that accelerates, against finite elements in motion and at rest under another gravity."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from cfem.core.errors import InputError, NumericalError
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.fe_motion.problem import MovingProblem
from cfem.fe_motion.simulate import StepControl, simulate
from cfem.fe_motion.start import at_rest
from cfem.mujoco import World
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

G, PERIOD, DT = 9.81, 0.8, 0.005
FREE = np.zeros(1)


def world_of(robot, joints, dt=DT, **more):
    """A base of 1000 kg, held by nothing, with the bar hanging from it along -z of the world."""
    body = f'<body gravcomp="1">{joints}<geom size="0.1" mass="1000" contype="0" conaffinity="0"/>'
    body += '<site name="bar" euler="0 90 0"/></body>'
    xml = f'<mujoco><option timestep="{dt}"/><worldbody>{body}</worldbody></mujoco>'
    return World(xml, {"bar": robot}, **more)


SLIDES = '<joint type="slide" axis="0 1 0"/>'


@pytest.fixture(scope="module")
def weighed(heavy_scene):
    """Finite elements, and nodal forces (n, 3) N of an acceleration along each axis of the bar, a mm/s^2."""
    spec = yaml.safe_load(heavy_scene.read_text())
    robots = []
    for axis in range(3):
        spec["gravity"] = {"acceleration": {"mm/s^2": np.eye(3)[axis].tolist()}}
        path = heavy_scene.with_name("one.yaml")
        path.write_text(yaml.safe_dump(spec))
        robots.append(build_robot(*load_scene_and_mesh(path)))
    return robots[0], np.stack([robot.loads for robot in robots])


def under(weighed, gravity):
    """The robot under gravity (3,) mm/s^2 in its own frame."""
    robot, loads = weighed
    return replace(robot, loads=np.tensordot(gravity, loads, 1))


def test_a_bar_that_hangs_from_a_shaken_base_goes_as_finite_elements_in_motion_do(heavy_bar, weighed):
    """Across its length, by up to 2 m/s^2 once to and fro within 0.8 s."""
    world = world_of(heavy_bar, SLIDES, inertia=True)
    hanging = np.array([1e3 * G, 0.0, 0.0])  # the bar's x is down
    robot = under(weighed, hanging)
    rest = solve(Problem(robot), displacement(FREE), slack=False)
    motion, tips, truth = at_rest(MovingProblem(robot), rest.state), [], []
    for k in range(round(PERIOD / DT)):
        t = (k + 0.5) * DT
        a = 3e3 * np.sin(np.pi * t / PERIOD) ** 2 * np.sin(2 * np.pi * t / PERIOD)
        world.data.qfrc_applied[0] = 1e3 * a / 1e3  # 1000 kg
        tips.append(world.step({"bar": FREE}).delta_e[0][1])
        run = simulate(
            MovingProblem(under(weighed, hanging + [0.0, -a, 0.0])),
            motion,
            lambda t: displacement(FREE),
            motion.t + DT,
            pace=StepControl(first=DT, tolerance=None),
        )
        motion = run.end
        truth.append(run.samples[-1].delta_e[1])
    truth, travel = np.array(truth), np.ptp(truth)
    assert travel > 0.1
    assert np.abs(np.array(tips) - truth).max() < 0.02 * travel


def test_an_even_acceleration_is_weight_the_other_way(heavy_bar, weighed):
    world = world_of(heavy_bar, SLIDES, inertia=True)
    world.data.qfrc_applied[0] = 1e3 * 4.0
    state = world.step({"bar": FREE})
    solved = solve(Problem(under(weighed, [1e3 * G, -4e3, 0.0])), displacement(FREE), slack=False)
    free = solve(Problem(under(weighed, [0.0] * 3)), displacement(FREE), slack=False)
    sag = np.linalg.norm((solved.delta_e - free.delta_e)[:3])
    assert sag > 0.3
    assert np.linalg.norm((state.delta_e[0] - solved.delta_e)[:3]) < 0.01 * sag


def test_a_base_that_turns_evenly_pulls_outwards_at_the_centre_of_mass(heavy_bar):
    """w^2 r at the centre of mass, which the base's own centre does not feel."""
    world = world_of(heavy_bar, '<joint axis="0 1 0"/>', 0.0005, inertia=True)
    world.model.opt.gravity[:] = 0.0
    world.data.qvel[0] = speed = 5.0
    state = world.step({"bar": FREE})
    weight = heavy_bar.weight
    r = heavy_bar.surface.model.rest_e[weight.rows]
    assert state.wrenches[0][weight.rows][0] == pytest.approx(weight.mass * speed**2 * r[0], rel=2e-3)


def test_without_it_no_acceleration_bends_a_robot(heavy_bar):
    world, still = (world_of(heavy_bar, SLIDES) for _ in range(2))
    world.data.qfrc_applied[0] = 1e3 * 4.0
    assert np.array_equal(world.step({"bar": FREE}).delta_e[0], still.step({"bar": FREE}).delta_e[0])


def test_a_base_that_moves_faster_than_the_model_knows_is_said(heavy_bar, soft_bar):
    world = world_of(heavy_bar, SLIDES, inertia=True)
    world.data.qfrc_applied[0] = 1e6
    with pytest.raises(NumericalError, match=r"the base of 'bar' accelerates so that 102 g bend it, .* knows .* g"):
        world.step({"bar": FREE})
    world = world_of(heavy_bar, '<joint axis="0 1 0"/>', inertia=True)
    world.data.qvel[0] = 12.0
    with pytest.raises(NumericalError, match=r"turns so fast that acceleration differs by 0\.\d+ g between its ends"):
        world.step({"bar": FREE})
    with pytest.raises(InputError, match="'bar' does not know its mass"):
        world_of(soft_bar, SLIDES, inertia=True)
