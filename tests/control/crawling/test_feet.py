"""A leg's effectors as the points that touch the ground."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar

from cfem.control.crawling.stage import _with_feet
from cfem.core.errors import InputError


@pytest.fixture(scope="module")
def robot():
    return bar(element="hex8", divisions=(4, 1, 1))


def test_effectors_become_contact_points(robot):
    leg = _with_feet(robot, np.zeros(0))
    assert leg.effectors == () and leg.rows.effectors == ()
    assert leg.rows.contacts == robot.rows.effectors and len(leg.contacts) == len(robot.effectors)
    np.testing.assert_allclose([contact.rest for contact in leg.contacts], robot.rest_e.reshape(-1, 3), atol=1e-9)
    assert leg.rows.actuators == robot.rows.actuators


def test_the_last_effector_carries_the_load_and_stays(robot):
    (tip,) = robot.effectors
    names = tuple(f"{name}.{axis}" for name in ("foot", "body") for axis in "xyz")
    heavy = replace(robot, effectors=(tip, tip), rows=replace(robot.rows, effectors=names))
    load = np.array([1e-3, -2e-3, 3e-3])
    leg = _with_feet(heavy, load)
    assert leg.rows.effectors == names[3:] and leg.rows.contacts == names[:3]
    assert leg.effectors == (tip,) and len(leg.contacts) == 1
    before = np.zeros(robot.X.size) if robot.loads is None else np.ravel(robot.loads)
    added = (np.ravel(leg.loads) - before).reshape(-1, 3).sum(axis=0)
    np.testing.assert_allclose(added, load, atol=1e-12)
    assert _with_feet(heavy, np.zeros(3)).loads is heavy.loads  # weightless


@pytest.mark.parametrize("load", [np.zeros(0), np.zeros(3)])
def test_without_a_point_to_stand_on_it_says_so(robot, load):
    none = replace(robot, effectors=robot.effectors[: len(load) > 0], rows=robot.rows)
    with pytest.raises(InputError, match="a leg touches the ground by effectors"):
        _with_feet(none, load)


def test_an_effector_that_is_no_point_is_refused(robot):
    with pytest.raises(InputError, match="is no point of its body"):
        _with_feet(replace(robot, effectors=(object(),)), np.zeros(0))
