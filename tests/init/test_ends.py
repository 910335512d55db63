"""Which end of a body is proposed to be held: one from which straight cables stay inside."""

import numpy as np
import pytest
from init.bodies import box_shape, corner, frame, tapered, tee

from cfem.constraint.attachment import locate
from cfem.core.errors import SpecError
from cfem.init.ends import place, propose
from cfem.init.hold import guess_hold, read_hold, run_from
from cfem.init.shape import Shape
from cfem.mechanics.mesh import Mesh


@pytest.mark.parametrize("shape", [box_shape(), tapered()], ids=["box", "tapered"])
def test_the_guess_stays_where_cables_from_it_stay_inside(shape):
    found = propose(shape, 3)
    assert (found.hold, found.why) == guess_hold(shape)
    assert len(found.placement.cables) == found.count == 3 and found.placement.whole


def test_an_l_is_held_at_the_end_of_a_leg_and_its_cables_end_before_the_corner():
    shape = corner()
    found = propose(shape, 3)
    assert str(guess_hold(shape)[0]) == "x <= 0 mm" and str(found.hold) == "x >= 60 mm"
    assert found.why == "cables from here stay inside the body, and those from x <= 0 mm would leave it"
    assert not found.placement.whole
    for cable in found.placement.cables:
        assert cable.pull[0] == 60 and 10 < cable.points[-1, 0] < 30
        ends = np.vstack([cable.pull, cable.points])
        along = np.concatenate([ends[:-1] + share * np.diff(ends, axis=0) for share in np.linspace(0, 1, 9)])
        assert (locate(shape.mesh, along, within=1e-9)[0] >= 0).all()


def test_ends_of_the_other_axis_come_after_those_of_the_longest():
    """A T: no straight cable passes the stem along the bar; one from the bar into the stem does."""
    shape = tee()
    assert guess_hold(shape)[0].axis == 0 and str(propose(shape, 1).hold) == "y <= 0 mm"


def test_where_no_end_will_do_the_guess_is_kept_and_its_cables_are_refused():
    shape = frame()
    found = propose(shape, 1)
    assert (found.hold, found.why, found.placement) == (*guess_hold(shape), None)
    with pytest.raises(SpecError, match=r"would leave the body|no room"):
        place(shape, run_from(found.hold, shape), 1)


def test_a_part_that_the_mesh_names_is_kept():
    shape = corner()
    named = Mesh(
        shape.mesh.X, shape.mesh.cells, shape.mesh.facets, node_sets={"fixed": np.flatnonzero(shape.mesh.X[:, 0] == 0)}
    )
    found = propose(Shape(named, 5.0), 3)
    assert found.hold.name == "fixed" and found.placement is None


def test_cables_end_early_from_a_part_that_the_user_chose():
    shape = corner()
    assert not place(shape, run_from(read_hold("y >= 60 mm", shape), shape), 2).whole
