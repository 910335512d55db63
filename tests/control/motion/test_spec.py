"""What a spec of a robot that moves may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.control.motion.spec import LapsSpec, MovingSpec, ShapingSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (MovingSpec, "substeps", 1, 0, [2]),
        (LapsSpec, "speeds", ["1 Hz"], [], []),
        (LapsSpec, "speeds", ["1 uHz"], ["0 Hz"], []),
        (LapsSpec, "laps", 1, 0, [1]),
        (LapsSpec, "run_up", "0 s", "-1 ms", [0.5]),
        (ShapingSpec, "modes", 1, 0, [1]),
        (ShapingSpec, "kind", "zvd", "zvdd", ["zv"]),
    ],
)
def test_what_a_robot_that_moves_is_told(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
