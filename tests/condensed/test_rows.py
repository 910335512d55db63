"""Two robots are told apart in words."""

from cfem.condensed import Rows

FINGER = Rows(("tip.x", "tip.y", "tip.z"), ("left", "right"))


def test_a_difference_names_what_differs_alone():
    bar = Rows(("tip.x", "tip.y", "tip.z"), ("cable",))
    assert bar.difference(FINGER, "the scene") == "drives cable, the scene left and right"
    touched = Rows(("end.x",), ("left", "right"), ("pad.x",))
    said = touched.difference(FINGER, "the scene")
    assert said == "watches end.x, the scene tip.x, tip.y and tip.z; it may be touched at pad.x, the scene nothing"


def test_blocks_follow_each_other_in_the_order_of_the_names():
    rows = Rows(("tip.x", "tip.rz"), ("left", "mid", "right"), ("pad.x", "pad.y", "pad.z", "pad.rx"))
    parts = rows.names[rows.e], rows.names[rows.a], rows.names[rows.c]
    assert parts == (rows.effectors, rows.actuators, rows.contacts)
    assert rows.names[rows.active] == rows.actuators + rows.contacts
    assert (rows.n_e, rows.n_a, rows.n_c, rows.n) == (2, 3, 4, 9)


def test_effector_rows_that_turn_are_in_radians():
    assert Rows(("arm.tip.x", "arm.tip.rz"), ("a",)).effector_units == (("mm", "N"), ("rad", "N mm"))
