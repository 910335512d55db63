"""A bar whose tip meets a wall: against the robot under the wall's force, and where it is free."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.plant.fem_plant import FemPlant, pushed
from cfem.plant.walled_plant import FrictionlessWall, WalledPlant

LIFT = np.array([-1.0, 1.0])


@pytest.fixture(scope="module")
def robot():
    return bar(element="tet4")


def wall_at(robot, share):
    """Below which the tip may be, at that share of how high it would rise."""
    free = FemPlant(robot).step(LIFT)
    rise = free.x_e - robot.rest_e
    return FrictionlessWall(robot.rest_e + share * rise, np.array([0.0, 0.0, -1.0])), free


def test_away_from_the_wall_the_robot_is_free(robot):
    wall, free = wall_at(robot, 1.5)
    plant = WalledPlant(robot, wall)
    np.testing.assert_array_equal(plant.step(LIFT).x_e, free.x_e)
    assert plant.force == 0.0


@pytest.mark.parametrize("kind", ["displacement", "force"])
def test_the_wall_stops_the_tip_with_the_force_that_it_takes(robot, kind):
    wall, free = wall_at(robot, 0.6)
    plant = WalledPlant(robot, wall)
    u = LIFT if kind == "displacement" else free.lambda_a
    stopped = plant.step(u, kind)
    assert stopped.status == "converged" and abs(wall.gap(stopped.x_e)) <= 1e-6 and plant.force > 0
    alone = FemPlant(pushed(robot, plant.force * wall.normal)).step(u, kind)
    np.testing.assert_allclose(stopped.x_e, alone.x_e, atol=1e-8)
    back = plant.step(np.zeros(2), kind)
    assert plant.force == 0.0 and wall.gap(back.x_e) > 0 and back.t == 2


def test_a_force_of_the_wall_that_is_not_found_is_no_position(robot, monkeypatch):
    wall, _ = wall_at(robot, 0.6)
    plant = WalledPlant(robot, wall)
    monkeypatch.setattr("cfem.plant.walled_plant.ITERATIONS", 2)
    plant._softness = 1e6  # mm/N: the trials are far too small
    found = plant.step(LIFT)
    assert found.status == "the wall's force is not found" and found.t == 1
    assert np.isnan(found.x_e).all() and len(found.delta_a) == 2


def test_a_robot_that_finds_no_balance_says_so_whatever_the_wall_does(robot, monkeypatch):
    wall, _ = wall_at(robot, 0.6)
    plant, step = WalledPlant(robot, wall), FemPlant.step

    def lost(self, u, kind):
        found = step(self, u, kind)
        return found if self is plant._free and not everywhere else replace(found, status="lost", t=9)

    monkeypatch.setattr(FemPlant, "step", lost)
    for everywhere in (False, True):
        found = plant.step(LIFT)
        assert found.status == "lost" and found.t == 1 + everywhere and plant.force == 0.0
