"""A robot that overlaps an obstacle, or is held where one comes, is refused by name."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.contact.obstacle import Plane, Sphere
from cfem.contact.prescribed_motion import Translation
from cfem.control.task.obstacles.clearance import demand_near, demand_outside, demand_way
from cfem.core.errors import SpecError

ROBOT = SimpleNamespace(X=np.array([[0.0, 0, 0], [10.0, 0, 0], [20.0, 0, 0]]), fixed=np.array([0]), length=20.0)
NODES = np.arange(3)


class Coming:
    """A ball of 1 mm that comes along z to the node at x mm, and goes deeper into it."""

    def __init__(self, x):
        self.x = x

    def at(self, share):
        return Sphere(1.0, t=np.array([self.x, 0.0, 3.0 - 2.5 * share]))


def test_what_is_beside_the_robot_is_allowed():
    demand_outside(ROBOT, NODES, {"ball": Sphere(2.0, t=np.array([20.0, 0, 2.0])), "floor": Plane()})


@pytest.mark.parametrize(
    ("obstacle", "what", "do"),
    [
        (Sphere(2.0, t=np.array([20.0, 0, 1.5])), r"0.5 mm inside it, at \(20, 0, 0\)", "move it away"),
        (Plane(t=np.array([0, 0, 0.25])), "0.25 mm inside it", "turn its normal out of it"),
    ],
)
def test_what_overlaps_is_named_with_depth_and_place(obstacle, what, do):
    with pytest.raises(SpecError, match=what) as caught:
        demand_outside(ROBOT, NODES, {"thing": obstacle})
    assert caught.value.where == "obstacles.thing" and do in caught.value.do


def test_a_node_that_is_not_of_the_surface_does_not_count():
    demand_outside(ROBOT, NODES[:2], {"ball": Sphere(2.0, t=np.array([20.0, 0, 0]))})


def test_a_way_to_where_the_robot_is_held_is_refused_and_one_to_its_tip_is_not():
    demand_way(ROBOT, NODES, {"ball": Coming(20.0)})
    demand_way(ROBOT, NODES[1:], {"ball": Coming(0.0)})  # the held node is within the body
    with pytest.raises(SpecError, match=r"leads 0\.\d+ mm into where the robot is held, 85 % through"):
        demand_way(ROBOT, NODES, {"ball": Coming(0.0)})


def test_what_stays_two_lengths_away_is_refused_and_what_comes_near_is_not():
    ball = Sphere(5.0, t=np.array([520.0, 0, 0]))
    demand_near(ROBOT, NODES, {"ball": Translation(ball, np.array([[0.0, 0, 0], [-470.0, 0, 0]]))})
    with pytest.raises(
        SpecError, match=r"obstacles\.ball: it is never nearer than 495 mm, 24\.8 times the robot's length"
    ):
        demand_near(ROBOT, NODES, {"ball": Translation(ball, np.zeros((1, 3)))})
