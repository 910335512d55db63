"""Self-contact in a scene."""

import numpy as np
import pytest
from robot.scenes import scene
from support.blocks import block

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.build import build_robot


def slotted(tmp_path, self_contact, closed=0.0):
    """The bar of 30 x 10 x 10 mm with a slot of 2 mm along its free half, whose upper leg ends `closed` mm lower."""
    plain = block((30, 10, 10), (12, 4, 5))
    middles = plain.X[plain.cells].mean(axis=1)
    cells = plain.cells[~((np.abs(middles[:, 2] - 5) < 1) & (middles[:, 0] > 15))]
    used, cells = np.unique(cells, return_inverse=True)
    cells = cells.reshape(-1, 4)
    X = plain.X[used] - [0, 5, 5]
    X[:, 2] -= np.where(X[:, 2] > 0, closed * np.clip(X[:, 0] / 15 - 1, 0, 1), 0)
    mesh = Mesh(X, cells, boundary_facets(cells))
    own = scene(tmp_path, self_contact=self_contact, mesh="{size: 5 mm, element: tet4}")
    return build_robot(own, mesh).body.contact


@pytest.mark.parametrize(("given", "onset"), [("{within: 3 mm}", 0.2), ("{within: 3 mm, onset: 20 %}", 0.4)])
def test_walls_of_a_slot_face_each_other(tmp_path, given, onset):
    contact = slotted(tmp_path, given)
    assert contact.weights.sum() == pytest.approx(15 * 10)  # half of either side
    assert contact.onset == pytest.approx(onset)


def test_none_is_asked_for_unless_the_scene_does(tmp_path):
    assert slotted(tmp_path, "false") is None
    with pytest.raises(SpecError, match=r"no walls of the body face each other within 1\.5 mm"):
        slotted(tmp_path, "true")


def test_a_body_that_overlaps_at_rest_is_refused(tmp_path):
    with pytest.raises(SpecError, match=r"self_contact: parts of the body pass through each other by .* mm at rest"):
        slotted(tmp_path, "{within: 3 mm}", closed=2.5)


def test_hexahedra_have_none(tmp_path):
    with pytest.raises(SpecError, match="self_contact: is of the faces of tetrahedra"):
        scene(tmp_path, self_contact="true", mesh="{size: 5 mm, element: hex8}")
