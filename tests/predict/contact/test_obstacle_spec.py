"""What a spec of an obstacle may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.predict.contact.obstacle_spec import (
    CapsuleObstacle,
    ContactSpec,
    MeshObstacle,
    PlaneObstacle,
    RobotObstacle,
    SphereObstacle,
)


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (PlaneObstacle, "press", "1 uN", "0 N", [None]),
        (PlaneObstacle, "largest_force", "1 uN", "0 N", [None]),
        (PlaneObstacle, "avoid", "1 um", "0 mm", [None]),
        (SphereObstacle, "radius", "1 um", "0 mm", []),
        (CapsuleObstacle, "radius", "1 um", "0 mm", []),
        (MeshObstacle, "unit", "1 um", "0 mm", [1.0]),
        (RobotObstacle, "shares", [[0.5]], [], []),
        (ContactSpec, "patches", "1 um", "0 mm", [None]),
        (ContactSpec, "friction", 0.0, -1e-9, [0.0]),
    ],
)
def test_what_an_obstacle_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
