"""What a spec of a controller that adapts may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.control.adaptation.spec import AdaptSpec, CameraSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (CameraSpec, "shift", "0 mm", "-1 um", [0.0]),
        (CameraSpec, "turn", "0 deg", "-1 deg", [0.0]),
        (AdaptSpec, "noise", "1 um", "0 mm", []),
        (AdaptSpec, "find", ["young"], [], [None]),
        (AdaptSpec, "forget", "1 us", "0 s", [2.0]),
        (AdaptSpec, "loss", "1 um", "0 mm", [None]),
    ],
)
def test_what_adapts(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
