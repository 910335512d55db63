"""The base of a crawler stands on pads that yield."""

import pytest
from pydantic import ValidationError
from support.spec_fields import demand_field

from cfem.control.crawling.spec import BaseSpec, CrawlingSpec, GaitSpec
from cfem.control.holding.spec import RobotSpec

BOX = {"centre": {"mm": [0, 0, 10]}, "half_size": {"mm": [20, 10, 5]}, "weight": "1 N"}


def test_pads_may_be_as_stiff_as_one_likes_and_never_rigid():
    assert BaseSpec(**BOX).pads == 0.01
    assert BaseSpec(**BOX, pads=1e-6).pads == 1e-6
    for pads in (0.0, -0.01):
        with pytest.raises(ValidationError, match="pads"):
            BaseSpec(**BOX, pads=pads)


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (BaseSpec, "weight", "1 uN", "0 N", []),
        (BaseSpec, "pads", 1e-9, 0.0, [1e-2]),
        (GaitSpec, "gravity", "0.1 m/s^2", "0 m/s^2", [None]),
        (GaitSpec, "steps", 1, 0, [16]),
        (GaitSpec, "cycles", 2, 1, [3]),
        (GaitSpec, "distance", "0.1 mm", "0 mm", [None]),
        (GaitSpec, "evaluations", 1, 0, [24]),
        (GaitSpec, "frictions", [0.0], [-0.1], [[]]),
        (CrawlingSpec, "robots", [{"name": "one"}], [], [[RobotSpec(name="robot")]]),
        (CrawlingSpec, "reached", "1 um", "0 mm", [0.1]),
    ],
)
def test_what_a_gait_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
