"""The frame, its covariance, and what is no frame."""

import numpy as np
import pytest
from identify.recordings.recordings import PLACES, SHIFT, TURN
from scipy.spatial.transform import Rotation

from cfem.core.errors import InputError
from cfem.identify.recordings.registration import register

AT = np.array(list(PLACES.values()))
SEEN = (AT - SHIFT) @ TURN


def test_covariance_is_the_scatter_of_repeated_registrations():
    rng, turns, shifts = np.random.default_rng(0), [], []
    for _ in range(400):
        found = register(SEEN + 0.3 * rng.standard_normal(SEEN.shape), AT, "a", 5)
        turns.append(Rotation.from_matrix(found.turn @ TURN.T).as_rotvec())
        shifts.append(found(SEEN.mean(axis=0)))
    one = register(SEEN + 0.3 * rng.standard_normal(SEEN.shape), AT, "a", 5)
    scale = 0.3 / (one.residual * np.sqrt(6 / 12))
    np.testing.assert_allclose(np.std(turns, axis=0), one.turn_sd * scale, rtol=0.15)
    np.testing.assert_allclose(np.std(shifts, axis=0), one.shift_sd * scale, rtol=0.15)


@pytest.mark.parametrize(
    ("seen", "message"),
    [
        (SEEN / 1000, "as if recorded in metres: the unit is another"),
        (SEEN * [1, 1, -1], "left-handed"),
        (SEEN + 30 * np.random.default_rng(1).standard_normal(SEEN.shape), "miss their places"),
        (SEEN[:2], "three are needed"),
    ],
)
def test_what_is_no_frame_is_told(seen, message):
    with pytest.raises(InputError, match=message):
        register(seen, AT[: len(seen)], "a", 5)


def test_markers_on_one_line_lay_no_frame():
    line = np.outer([0.0, 10.0, 30.0], [1.0, 2.0, 0.5])
    with pytest.raises(InputError, match="one line"):
        register(line, line, "a", 5)
