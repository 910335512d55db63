"""How cables are suggested, and which end of a body is proposed to be held: one from which they stay inside."""

import numpy as np
import pytest
from init.bodies import box_shape, cage, corner, discs, frame, lattice, star, tapered, tee

from cfem.constraint.attachment import locate
from cfem.core.errors import SpecError
from cfem.init.body.shape import Shape
from cfem.init.cables.centreline import centreline
from cfem.init.cables.ends import inside, place, propose
from cfem.init.hold import guess_hold, read_hold, run_from
from cfem.mechanics.mesh import Mesh


def all_inside(shape, cables) -> bool:
    """Whether all cables are, between their points too."""
    for cable in cables:
        ends = np.vstack([cable.pull, cable.points])
        along = np.concatenate([ends[:-1] + share * np.diff(ends, axis=0) for share in np.linspace(0, 1, 9)])
        if not (locate(shape.mesh, along, within=1e-6)[0] >= 0).all():
            return False
    return True


@pytest.mark.parametrize("shape", [box_shape(), tapered()], ids=["box", "tapered"])
def test_the_guess_stays_where_cables_from_it_stay_inside(shape):
    found = propose(shape, 3)
    assert (found.hold, found.why) == guess_hold(shape)
    assert len(found.placement.cables) == found.count == 3 and not found.placement.through_air


def test_an_l_is_held_at_the_end_of_a_leg_and_its_cables_follow_it_around_the_corner():
    shape = corner()
    found = propose(shape, 3)
    assert str(guess_hold(shape)[0]) == "x <= 0 mm" and str(found.hold) in ("x >= 60 mm", "y >= 60 mm")
    assert found.why == "the longest way through the body begins here"
    along, across = (0, 1) if found.hold.axis == 0 else (1, 0)
    for cable in found.placement.cables:
        assert cable.pull[along] == 60 and cable.points[-1, across] > 45
    assert all_inside(shape, found.placement.cables) and "along the middle of the body" in found.placement.how


def test_a_t_has_cables_that_stay_inside():
    """No straight cable passes the stem along the bar."""
    shape = tee()
    assert all_inside(shape, propose(shape, 1).placement.cables)


def test_cables_pass_where_another_branch_begins_without_a_detour_into_it():
    shape = star()
    run = run_from(guess_hold(shape)[0], shape)
    middle = centreline(shape.voxels, run)
    found = inside(shape, run, 3, middle)
    assert len(found.cables) == 3 and max(cable.length for cable in found.cables) < 1.1 * middle.length


def test_a_ring_has_a_cable_in_each_half():
    shape = frame()
    found = place(shape, run_from(guess_hold(shape)[0], shape), 1)
    assert len(found.cables) == 2 and "one along each of 2 legs" in found.how and all_inside(shape, found.cables)
    sides = np.sign([cable.points[:2, 1].mean() - 30 for cable in found.cables])
    assert sorted(sides) == [-1, 1]


@pytest.mark.slow
def test_a_body_of_four_legs_is_held_where_all_four_begin():
    """From its sides, which are farther apart, two ways lead around."""
    shape = cage()
    found = propose(shape, 3)
    assert str(found.hold) == "y <= 0 mm" and found.why.startswith("4 cables find a way from here, and 2 from ")
    assert len(found.placement.cables) == 4 and all_inside(shape, found.placement.cables)


def test_as_many_cables_as_asked_for_lead_through_the_rings_of_a_lattice():
    shape = lattice()
    run = run_from(guess_hold(shape)[0], shape)
    found = place(shape, run, 4)
    assert found.through_air and len(found.cables) == 4
    middles = np.array([cable.points[:, :2].mean(axis=0) for cable in found.cables]) - 12
    assert np.abs(middles.sum(axis=0)).max() < 1 and (np.linalg.norm(middles, axis=1) > 8).all()


@pytest.mark.slow
def test_a_backbone_with_discs_has_cables_through_the_air_unless_that_is_not_wanted():
    shape = discs()
    run = run_from(read_hold("z <= 0 mm", shape), shape)
    found, within = place(shape, run, 4), place(shape, run, 4, air=False)
    assert found.through_air and len(found.cables) == 4 and not all_inside(shape, found.cables)
    assert not within.through_air and all_inside(shape, within.cables)
    for cable in found.cables:
        assert (locate(shape.mesh, cable.points, within=1e-6)[0] >= 0).all()
        assert np.linalg.norm(cable.points[:, :2] - 10, axis=1).min() > 4 * 1.2


def test_where_there_is_no_way_at_all_the_reason_is_that_of_straight_cables():
    shape = box_shape((60.0, 10.0, 10.0))
    with pytest.raises(SpecError, match=r"passes 3 parts of the body.*--fixed"):
        place(shape, run_from(read_hold("x <= 0 mm", shape), shape), 2, air=True)


def test_a_part_that_the_mesh_names_is_kept():
    shape = corner()
    named = Mesh(
        shape.mesh.X, shape.mesh.cells, shape.mesh.facets, node_sets={"fixed": np.flatnonzero(shape.mesh.X[:, 0] == 0)}
    )
    found = propose(Shape(named, 5.0), 3)
    assert found.hold.name == "fixed" and found.placement is None
