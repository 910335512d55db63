"""What a spec of a motion may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.motion.spec import PayloadSpec, SimulateSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (PayloadSpec, "mass", "1 ug", "0 g", []),
        (SimulateSpec, "until", "1 us", "0 s", [None]),
        (SimulateSpec, "step", "1 us", "0 s", [None]),
    ],
)
def test_what_moves(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
