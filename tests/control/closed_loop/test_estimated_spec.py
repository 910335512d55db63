"""What a spec of an estimator in a loop may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.control.closed_loop.estimated_spec import LoopEstimateSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (LoopEstimateSpec, "lost", 0.999, 1.0, [0.0]),
        (LoopEstimateSpec, "wrong", 0.0, -1e-9, [0.0]),
        (LoopEstimateSpec, "astray", "1 um", "0 mm", [20.0]),
    ],
)
def test_what_markers_of_a_loop_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
