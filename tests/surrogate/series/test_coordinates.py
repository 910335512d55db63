"""Box coordinates hold the data, turn with the form's axes and leave parameters alone."""

import numpy as np

from cfem.surrogate.series.coordinates import box_coordinates, mean_square

RNG = np.random.default_rng(0)


def test_the_box_holds_the_data_and_parameters_keep_their_axis():
    s, q = RNG.normal(size=(50, 3)) * [1.0, 10.0, 0.1], RNG.uniform(-2, 5, (50, 2))
    to_box, offset = box_coordinates(s, q, np.diag([3.0, 1.0, 2.0]))
    z = np.hstack([s, q]) @ to_box.T + offset
    assert np.allclose([z.min(axis=0), z.max(axis=0)], np.array([[-1.0], [1.0]]) / 1.02)
    assert not to_box[:3, 3:].any() and not to_box[3:, :3].any()
    assert np.count_nonzero(to_box[3:, 3:]) == 2


def test_a_coordinate_that_does_not_vary_is_harmless():
    s = np.column_stack([RNG.normal(size=20), np.full(20, 3.0)])
    to_box, offset = box_coordinates(s, np.zeros((20, 0)), np.eye(2))
    assert np.isfinite(s @ to_box.T + offset).all()


def test_mean_square_tells_the_direction_along_which_a_map_bends():
    turn = np.linalg.qr(RNG.normal(size=(4, 4)))[0]
    bend = RNG.uniform(-1, 1, (60, 4)) @ turn[0]
    hessians = np.stack([-np.sin(bend), -np.cos(bend)], axis=1)[:, :, None, None] * np.outer(turn[0], turn[0])
    first, second = np.triu_indices(4)
    found = mean_square(hessians[:, :, first, second].swapaxes(1, 2), 4)
    assert np.allclose(found, np.outer(turn[0], turn[0]), atol=1e-12)  # sin^2 + cos^2 = 1
