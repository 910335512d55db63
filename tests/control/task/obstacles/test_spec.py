"""What a spec of obstacles may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.control.task.obstacles.spec import ObstaclesSpec, StatedContactSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (StatedContactSpec, "error_places", 0, -1, [40]),
        (StatedContactSpec, "error_places", 1000, 1001, [40]),
        (ObstaclesSpec, "obstacles", {"a": {"kind": "itself"}}, {}, []),
    ],
)
def test_what_obstacles_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
