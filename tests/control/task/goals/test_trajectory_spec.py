"""What a spec of a trajectory may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.control.task.goals.trajectory_spec import ArcSpec, HalfSphereSpec, ImageSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (ArcSpec, "from_rest", 0, -1, [0]),
        (HalfSphereSpec, "turns", 0.5, "x", [3.0]),
        (ImageSpec, "centre", 0.4, "x", [0.45]),
        (ImageSpec, "radii", [0.1, 0.2], "x", [0.3]),
    ],
)
def test_what_a_trajectory_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
