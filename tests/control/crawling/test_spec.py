"""The base of a crawler stands on pads that yield."""

import pytest
from pydantic import ValidationError

from cfem.control.crawling.spec import BaseSpec

BOX = {"centre": {"mm": [0, 0, 10]}, "half_size": {"mm": [20, 10, 5]}, "weight": "1 N"}


def test_pads_may_be_as_stiff_as_one_likes_and_never_rigid():
    assert BaseSpec(**BOX).pads == 0.01
    assert BaseSpec(**BOX, pads=1e-6).pads == 1e-6
    for pads in (0.0, -0.01):
        with pytest.raises(ValidationError, match="pads"):
            BaseSpec(**BOX, pads=pads)
