"""Two robots are told apart in words."""

from cfem.condensed import Rows

FINGER = Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))


def test_a_difference_names_what_differs_alone():
    bar = Rows(("tip.x", "tip.y", "tip.z"), ("cable",))
    assert bar.difference(FINGER, "the scene") == "drives cable, the scene left and right"
    touched = Rows(("end.x",), ("left", "right"), ("pad.x",))
    said = touched.difference(FINGER, "the scene")
    assert said == "watches end.x, the scene tip.x, tip.y and tip.z; it may be touched at pad.x, the scene nothing"
