"""Control of held objects begins where the model has data; a box has the surface that a box has."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.contact.surface.facets import unmatched_edges
from cfem.control.holding.assembly import _taut_state, box_surface


def test_it_begins_at_the_training_state_nearest_to_the_middle_of_their_box():
    """Two actuators and a pose of one coordinate; in shares of each range, the third state is 0.1 off."""
    displacements = np.array([[0.0, 0.0, 5.0], [10.0, 2.0, 7.0], [4.0, 1.0, 6.2], [2.0, 1.9, 5.0]])
    states = np.hstack([displacements, np.zeros((4, 3))])
    predictor = SimpleNamespace(domain=SimpleNamespace(states=states))
    np.testing.assert_array_equal(_taut_state(predictor, 1), [4.0, 1.0])


@pytest.mark.parametrize("width", [3, 4, 6])
def test_the_surface_of_a_box_is_closed_and_holds_its_volume(width):
    """Volume by the divergence theorem, facet by facet, as triangles about the first node; middles lie on straight
    sides."""
    points, facets = box_surface((1.0, -2.0, 0.5), np.array([2.0, 3.0, 4.0]), width)
    corners = facets[:, :4] if width == 4 else facets[:, :3]
    fans = [corners[:, [0, k, k + 1]] for k in range(1, corners.shape[1] - 1)]
    volume = sum(np.linalg.det(points[fan]).sum() / 6 for fan in fans)
    assert volume == pytest.approx(4 * 6 * 8)
    places = np.unique(points, axis=0, return_inverse=True)[1].ravel()  # facets of six nodes share none of them
    assert unmatched_edges(places[facets]).size == 0
