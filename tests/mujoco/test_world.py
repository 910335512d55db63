"""Soft robots in MuJoCo, against finite elements, balance, momentum and energy."""

import mujoco
import numpy as np
import pytest
from support.obstacle_step import obstacle_step

from cfem.contact.obstacle import Sphere
from cfem.core.errors import InputError, NumericalError, SpecError
from cfem.equilibrium.contact.patch_compliance import with_patches
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.mujoco import World

G, MASS = 9.81, 0.002
GUIDED = '<joint type="slide" axis="0 0 1"/>'
BALL = '<geom name="ball" type="sphere" size="0.006" mass="0.002"/>'


def mjcf(body, dt=0.002, options="", more="", carrier='<site name="bar"/>'):
    """A bar at the origin and a body."""
    return f'<mujoco><option timestep="{dt}" {options}/>{more}<worldbody>{carrier}{body}</worldbody></mujoco>'


def ball_above(z=0.0125, joint=GUIDED):
    return f'<body name="ball" pos="0.055 0 {z}">{joint}{BALL}</body>'


def steps(world, seconds, commands=None):
    """States of a world after each step."""
    for _ in range(round(seconds / world.model.opt.timestep)):
        yield world.step(commands or {})


def test_a_standing_ball_presses_as_it_presses_finite_elements(soft_bar, fe_bar):
    """The bar bends up against a ball that stands still."""
    patched, delta = soft_bar.surface, np.array([2.0])
    places = patched.patches.mean(patched.model.shape(delta))
    at = places[np.argmax(places[:, 2] + places[:, 0] / 10)]
    ball = Sphere(8.0, t=at + np.array([0.0, 0.0, 7.7]))  # 0.3 mm deep
    geom = f'<geom name="ball" type="sphere" size="0.008" pos="{" ".join(map(str, ball.t / 1e3))}"/>'
    world = World(mjcf(geom), {"bar": soft_bar}, friction=0.0)
    for share in np.linspace(0.1, 1.0, 10):
        state = world.step({"bar": share * delta})
    near = np.flatnonzero(np.linalg.norm(places - at, axis=1) < 12.0)
    truth = obstacle_step(
        Problem(with_patches(fe_bar, patched.model.skin.nodes, patched.patches, near)),
        displacement(delta),
        [ball] * len(near),
    )
    (solved,) = truth.solved
    force = solved.lambda_c.reshape(-1, 3).sum(axis=0)
    assert np.linalg.norm(world.force("bar", "ball") - force) < 0.02 * np.linalg.norm(force)
    assert np.linalg.norm(state.delta_e[0] - solved.delta_e) < 0.02 * np.linalg.norm(solved.delta_e)
    tip = (patched.model.rest_e + state.delta_e[0]) / 1e3
    assert np.array_equal(world.data.sensor("bar.tip").data, tip)
    assert np.array_equal(world.data.sensor("bar.force").data, world.force("bar"))


@pytest.mark.parametrize("integrator", ["Euler", "RK4", "implicit", "implicitfast"])
def test_a_step_without_contact_is_predicted_as_mujoco_takes_it(soft_bar, integrator):
    """Of a body that tumbles and is damped."""
    body = '<body name="far" pos="0 0 1"><freejoint/><geom type="box" size="0.01 0.02 0.03" mass="0.1"/></body>'
    swings = '<joint axis="1 0 0" damping="0.01"/><geom type="box" size="0.01 0.02 0.03" pos="0 0.1 0"/>'
    world = World(
        mjcf(f'{body}<body pos="0 1 1">{swings}</body>', 0.01, f'integrator="{integrator}"'), {"bar": soft_bar}
    )
    alone = mujoco.MjData(world.model)
    alone.qvel[:] = world.data.qvel[:] = [0.1, 0.2, 0.3, 9.0, -7.0, 5.0, 3.0]
    for _ in range(3):
        world.step({})
        mujoco.mj_step(world.model, alone)
        assert np.array_equal(world._ahead.qpos, alone.qpos) and np.array_equal(world.data.qpos, alone.qpos)


def test_a_ball_that_falls_on_the_bar_comes_to_rest_under_its_weight_and_gains_no_energy(soft_bar):
    world, height = World(mjcf(ball_above()), {"bar": soft_bar}), []
    for state in steps(world, 0.8):
        z, v = world.data.qpos[0], world.data.qvel[0]
        height.append(1e3 * (MASS * G * z + MASS * v**2 / 2) + state.stored)  # N mm
    assert world.force("bar")[2] == pytest.approx(-MASS * G, rel=1e-3)
    assert abs(world.data.qvel[0]) < 1e-4
    assert np.diff(height).max() < 1e-6 * np.ptp(height)
    assert world.energies.lost == pytest.approx(height[0] - height[-1], rel=0.01)


@pytest.mark.parametrize(("points", "gives"), [("patches", 5e-3), pytest.param("nodes", 1e-2, marks=pytest.mark.slow)])
def test_a_soft_robot_that_falls_on_another_rests_on_it(soft_bar, bar_of_nodes, points, gives):
    """Its base slides: two bars press each other in the same problem."""
    soft_bar = bar_of_nodes() if points == "nodes" else soft_bar
    base = '<body pos="0.05 0 0.012"><joint type="slide" axis="0 0 1"/><site name="up" pos="0.06 0 0" euler="0 0 180"/>'
    base += '<geom type="box" size="0.005 0.005 0.005" pos="0.065 0 0" mass="0.002"/></body>'
    world = World(mjcf(base, 0.004), {"bar": soft_bar, "up": soft_bar}, friction=0.3, robots_touch=True)
    lost = []
    for _ in steps(world, 0.8):
        lost.append(world.energies.lost)
    assert world.force("bar")[2] == pytest.approx(-MASS * G, rel=0.05)
    assert world.force("up") == pytest.approx(-world.force("bar"), abs=1e-12)
    assert (
        np.diff(lost).min() > -gives * lost[-1]
    )  # slip is counted along surfaces that turn: of first order in the step
    assert lost[-1] + world.contact.stored == pytest.approx(-1e3 * MASS * G * world.data.qpos[0], rel=0.01)  # N mm


def test_impulse_and_angular_impulse_balance(soft_bar):
    """A bar on a body that flies, and a ball that flies into it."""
    carrier = '<body name="base" pos="-0.01 0 0"><freejoint/><geom type="box" size="0.01 0.01 0.01" mass="0.01"/>'
    carrier += '<site name="bar" pos="0.01 0 0"/></body>'
    world = World(
        mjcf(ball_above(0.0125, "<freejoint/>"), 0.0005, 'gravity="0 0 0"', carrier=carrier), {"bar": soft_bar}
    )
    world.data.qvel[8] = -0.2
    largest, fastest, begin = 0.0, 0.0, _momentum(world)
    for state in steps(world, 0.04):
        largest = max(largest, np.abs(state.forces).max(initial=0.0))
        now = _momentum(world)
        assert now[:3] == pytest.approx(begin[:3], abs=1e-12)
        assert now[3:] == pytest.approx(begin[3:], abs=1e-9)
        fastest = max(fastest, np.abs(world.data.qvel[:3]).max())
    assert largest > 0.005 and fastest > 0.002


def _momentum(world):
    """N s and N m s about the origin."""
    model, data = world.model, world.data
    mujoco.mj_forward(model, data)
    mujoco.mj_subtreeVel(model, data)
    p = data.subtree_linvel[0] * model.body_subtreemass[0]
    return np.concatenate([p, data.subtree_angmom[0] + np.cross(data.subtree_com[0], p)])


def test_shorter_steps_converge(soft_bar):
    ends = []
    for dt in (0.004, 0.002, 0.001, 0.00025):
        world = World(mjcf(ball_above(), dt), {"bar": soft_bar})
        assert len(list(steps(world, 0.04)))
        ends.append(world.data.qpos[0])
    off = np.abs(np.array(ends[:-1]) - ends[-1])
    assert off[0] > 1.4 * off[1] > 1.4 * 1.4 * off[2] > 0


def test_a_bent_bar_throws_a_ball_with_the_work_of_its_cable(soft_bar):
    world = World(mjcf(ball_above(0.0115)), {"bar": soft_bar})
    for _ in steps(world, 0.3):
        pass
    for delta in np.linspace(0.0, 3.0, 100):
        world.step({"bar": [delta]})
        assert world.energies.lost > -1e-3
    assert world.energies.commanded > 0.01


def test_what_is_saved_goes_on_with_the_same_digits(soft_bar):
    world, other = (World(mjcf(ball_above()), {"bar": soft_bar}) for _ in range(2))
    for _ in steps(world, 0.06):
        pass
    saved = world.save()
    for each in (world, other):
        each.restore(saved)
        for _ in steps(each, 0.02, {"bar": [0.3]}):
            pass
    assert np.array_equal(world.data.qpos, other.data.qpos)
    assert np.array_equal(world.contact.forces, other.contact.forces)
    world.restore(saved)
    for _ in steps(world, 0.02, {"bar": [0.3]}):
        pass
    assert np.array_equal(world.data.qpos, other.data.qpos)
    world.reset()
    assert world.contact is None and world.data.time == 0.0


def test_the_skin_that_is_drawn_is_where_the_robot_is(soft_bar):
    carrier = '<body pos="0.1 0.2 0.3" euler="0 0 90"><joint type="slide"/><geom size="0.01" mass="1"/>'
    world = World(mjcf("", options='gravity="0 0 0"', carrier=carrier + '<site name="bar"/></body>'), {"bar": soft_bar})
    world.step({"bar": [3.0]})
    world.draw()
    surface = soft_bar.surface.model.shape([3.0])
    turned = surface @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    assert world.data.flexvert_xpos == pytest.approx(turned / 1e3 + [0.1, 0.2, 0.3], abs=1e-9)
    scene = mujoco.MjvScene(world.model, maxgeom=10)
    options, camera = mujoco.MjvOption(), mujoco.MjvCamera()
    mujoco.mjv_updateScene(world.model, world.data, options, None, camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene)
    assert scene.flexvert.reshape(-1, 3)[: len(turned)] == pytest.approx(world.data.flexvert_xpos, abs=1e-6)


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (ball_above(0.008), "'ball' and the soft robot 'bar' overlap by 3 mm at the start"),
        ("<geom/>", "the MuJoCo model: .*size"),
    ],
)
def test_what_no_world_is_made_of_is_said(soft_bar, body, said):
    with pytest.raises(InputError, match=said):
        World(mjcf(body), {"bar": soft_bar})


def test_a_flat_height_field_is_a_ceiling(soft_bar):
    """The bar bends up against it as against a plane."""
    field = '<asset><hfield name="flat" nrow="4" ncol="4" size="0.1 0.1 0.001 0.01"/></asset>'
    ceilings = '<geom type="plane" size="1 1 1"', '<geom type="hfield" hfield="flat"'
    pressed = []
    for geom in ceilings:
        world = World(mjcf(f'{geom} pos="0 0 0.0075" zaxis="0 0 -1"/>', more=field), {"bar": soft_bar})
        for command in (0.5, 1.0, 1.5):
            world.step({"bar": [command]})
        assert world.contact.forces.any()
        pressed.append((world.contact.forces.sum(axis=0), world.contact.delta_e[0]))
    np.testing.assert_allclose(pressed[1][0], pressed[0][0], rtol=1e-6)
    np.testing.assert_allclose(pressed[1][1], pressed[0][1], atol=1e-7)


def test_who_is_not_there_is_said(soft_bar):
    with pytest.raises(InputError, match=r"no site 'hand'.*known are bar"):
        World(mjcf(""), {"hand": soft_bar})
    world = World(mjcf(""), {"bar": soft_bar})
    with pytest.raises(SpecError, match="no soft robot 'hand'"):
        world.step({"hand": [1.0]})
    with pytest.raises(SpecError, match="one finite number for each of its actuators, cable"):
        world.step({"bar": [1.0, 2.0]})


def test_too_long_a_step_and_energy_from_nowhere_end_it(soft_bar):
    world = World(mjcf(ball_above(0.03)), {"bar": soft_bar})
    world.step({})
    world.data.qvel[0] = -15.0
    before = world.data.qpos.copy()
    with pytest.raises(NumericalError, match=r"'ball' goes 30 mm in one step near a soft robot.*shorter than 0.002 s"):
        world.step({})
    assert np.array_equal(world.data.qpos, before)
    world.data.qvel[0] = 0.0
    world.energies = type(world.energies)(passed=1.0, turned=1.0)
    with pytest.raises(NumericalError, match="contact has given 1 N mm more than it was given"):
        world.step({})
