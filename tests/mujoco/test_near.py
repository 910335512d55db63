"""Steps of the points that may touch alone, against steps of all points."""

import gc
import sys

import numpy as np
import pytest

from cfem.contact.obstacle_set import ObstacleSet
from cfem.core.errors import NumericalError
from cfem.mujoco import World
from cfem.mujoco.near import REACH, Look
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.state import TRUSTED
from cfem.predict.contact.surface.surfaces import Surfaces

TURNING = """<mujoco><option timestep="0.002"/><worldbody>
  <body><joint axis="0 0 1" damping="1"/><geom size="0.004" pos="-0.01 0 0" mass="1"/><site name="bar"/></body>
  <body pos="0.055 0 0.0115"><joint type="slide" axis="0 0 1"/>
    <geom name="ball" type="sphere" size="0.006" mass="0.002"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def asked(monkeypatch):
    """Numbers of points whose distance looks ask."""
    counts, nearest = [], ObstacleSet.nearest

    def counted(self, points, *far):
        counts.append(len(points))
        return nearest(self, points, *far)

    monkeypatch.setattr(ObstacleSet, "nearest", counted)
    return counts


def test_forces_are_those_of_all_points_and_few_of_these_are_asked(soft_bar, asked, monkeypatch):
    """A ball falls on the bar, which turns about its base and bends."""
    ends, counts = [], []
    for everywhere in (False, True):
        if everywhere:
            monkeypatch.setattr(Look, "step", lambda look, scene, deltas, before: (scene.step(deltas, before), look))
        world = World(TURNING, {"bar": soft_bar})
        world.data.qvel[0] = 0.1
        asked.clear()
        for i in range(150):
            world.step({"bar": [0.005 * i]})
            asked.append(2 * len(world.points))
        ends.append((world.data.qpos.copy(), world.force("bar", "ball"), world.contact.lambda_a[0]))
        counts.append(sum(asked))
    for few, every in zip(*ends, strict=True):
        assert few == pytest.approx(every, rel=1e-9, abs=1e-12)
    assert np.linalg.norm(ends[0][1]) > 0.005
    assert counts[0] < counts[1] / 7


def test_no_point_comes_nearer_than_is_said(soft_bar):
    world = World(TURNING, {"bar": soft_bar})
    world.data.qvel[0], largest = 1.0, 0.0
    whole = Surfaces([soft_bar.surface])
    everywhere = Look.nowhere(whole)
    for i in range(15):
        state = world.step({"bar": [0.02 * i]})
        if i == 0:
            first, look = state.obstacles, everywhere.again(whole, everywhere.taken(state, world.points))
            before = everywhere.places(state)
        nearer = first.nearest(before)[0] - state.obstacles.nearest(everywhere.places(state))[0]
        share = nearer.max() / (REACH * soft_bar.surface.model.length)
        largest = max(largest, share)
        assert share <= look.moved(state) + 1e-12
    assert largest > 0.3


def test_skins_are_there_after_a_step_that_fails(soft_bar):
    named = TURNING.replace("<body><joint", '<body name="base"><joint')  # else its skin is the world's
    world, count = World(named, {"bar": soft_bar}), len(soft_bar.surface.model.skin.rest)
    body = world.model.body("base").id
    for fails in (False, True):
        if fails:
            with pytest.raises(Exception, match="one finite number"):
                world.step({"bar": [1.0, 2.0]})
        assert world.model.flex_vertnum.tolist() == [count]
        assert world.model.flex_vertbodyid.tolist() == [body] * count and body > 0
    with world._skins_hidden():
        assert not world.model.flex_vertnum.any() and not world.model.flex_vertbodyid.any()


def test_a_ball_that_bends_the_bar_beyond_what_its_model_knows_is_said_to(soft_bar):
    """It falls 90 mm, and sinks until the bar nearly buckles under it."""
    world = World(TURNING.replace("0.055 0 0.0115", "0.055 0 0.1015"), {"bar": soft_bar})
    with pytest.raises(NumericalError, match=r"no balance.*just before, forces bent a robot so far") as raised:
        for _ in range(90):
            world.step({"bar": [0.0]})
    assert world.contact.error > TRUSTED and "more slowly or with less mass" in raised.value.do


@pytest.mark.parametrize(("gravity", "steps", "most"), [(0.0, 5, 230), (-9.81, 150, 230)])  # free, in contact
def test_a_step_makes_few_calls(soft_bar, gravity, steps, most):
    """Of Python and C, of which each takes about as long as any other: the median of steps at rest."""
    option = f'timestep="0.002" gravity="0 0 {gravity}"'
    world, counts = World(TURNING.replace('timestep="0.002"', option), {"bar": soft_bar}), []
    for _ in range(steps + 9):
        calls = []
        sys.setprofile(lambda frame, event, given, calls=calls: calls.append(event))
        try:
            state = world.step({"bar": [0.0]})
        finally:
            sys.setprofile(None)
        counts.append(calls.count("call") + calls.count("c_call"))
    assert state.forces.any() == (gravity < 0)
    assert np.median(counts[steps:]) < most


def test_steps_leave_nothing_for_python_to_collect(soft_bar):
    world = World(TURNING, {"bar": soft_bar})
    for _ in range(2):
        gc.collect()
        gc.disable()
        try:
            for i in range(20):
                world.step({"bar": [0.01 * i]})
        finally:
            gc.enable()
        left = gc.collect()
    assert left == 0


def test_robots_that_are_held_as_in_the_last_step_are_joined_once(soft_bar, monkeypatch):
    """And as long as the same points are known."""
    counts = {"_free": 0, "_with": 0}

    def counted(name, function):
        def call(*given):
            counts[name] += 1
            return function(*given)

        return call

    for name in counts:
        monkeypatch.setattr(LoadedRobots, name, counted(name, getattr(LoadedRobots, name)))
    world = World(TURNING, {"bar": soft_bar})
    for i in range(160):
        counts |= dict.fromkeys(counts, 0)
        state = world.step({"bar": [min(0.005 * i, 0.5)]})
        if i == 50:
            assert counts["_free"] == 1 and counts["_with"] >= 1
    assert state.forces.any() and not any(counts.values())
