"""What a spec of obstacles may say, and says where it is silent."""

from pathlib import Path

import pytest
from support.spec_fields import demand_field

from cfem.control.spec import ControlSpec
from cfem.control.task.obstacles.spec import ObstaclesSpec, StatedContactSpec
from cfem.core.spec import load_spec

PIPELINES = Path(__file__).parents[4] / "pipelines"


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


@pytest.mark.parametrize(
    ("obstacle", "contact", "places"),
    [
        ("{kind: sphere, centre: {mm: [0, 0, 90]}, radius: 8 mm}", "{patches: 8 mm}", 40),
        ("{kind: itself}", "{friction: 0.3}", 40),
        ("{kind: itself}", "{error_places: 0}", 0),
        ("{kind: itself}", "{patches: 8 mm}", 0),
    ],
)
def test_the_error_is_calibrated_but_where_soft_surfaces_meet_by_patches(obstacle, contact, places):
    changes = [f"obstacles={{it: {obstacle}}}", f"contact={contact}"]
    assert load_spec(PIPELINES / "pincer" / "control.yaml", ControlSpec, changes).error_places == places
