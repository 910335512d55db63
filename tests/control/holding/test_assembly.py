"""Control of held objects begins where the model has data."""

from types import SimpleNamespace

import numpy as np

from cfem.control.holding.assembly import _taut_state


def test_it_begins_at_the_training_state_nearest_to_the_middle_of_their_box():
    """Two actuators and a pose of one coordinate; in shares of each range, the third state is 0.1 off."""
    displacements = np.array([[0.0, 0.0, 5.0], [10.0, 2.0, 7.0], [4.0, 1.0, 6.2], [2.0, 1.9, 5.0]])
    states = np.hstack([displacements, np.zeros((4, 3))])
    predictor = SimpleNamespace(domain=SimpleNamespace(states=states))
    np.testing.assert_array_equal(_taut_state(predictor, 1), [4.0, 1.0])
