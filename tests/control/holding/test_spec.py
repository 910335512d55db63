"""What a spec of robots that hold an object may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.control.holding.spec import HoldingSpec, ObjectSpec, RobotSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (ObjectSpec, "friction", 0.0, -1e-9, [0.0]),
        (ObjectSpec, "margin", 1.0, 0.99, [None]),
        (RobotSpec, "name", "left_1-A", "a b", []),
        (HoldingSpec, "robots", [{"name": "a"}], [], [[RobotSpec(name="robot")]]),
    ],
)
def test_what_holds_an_object(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
