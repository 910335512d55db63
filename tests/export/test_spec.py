"""What an export's spec refuses."""

import pytest
from pydantic import ValidationError

from cfem.export.spec import CSpec

WALL = {"kind": "plane", "point": {"mm": [0, 0, 9]}, "normal": [0, 0, -1]}


@pytest.mark.parametrize(
    "more", [{"press": "1 N"}, {"largest_force": "1 N"}, {"avoid": "1 mm"}, {"path": {"mm": [[0, 0, 0], [0, 0, 5]]}}]
)
def test_what_the_program_on_the_robot_decides_is_not_stated(more):
    assert CSpec(obstacles={"wall": WALL}).obstacles
    with pytest.raises(ValidationError, match=r"obstacles.wall: press, .* path are of `cfem control` alone"):
        CSpec(obstacles={"wall": WALL | more})
