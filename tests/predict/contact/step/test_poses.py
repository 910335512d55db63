"""From where slip counts on bodies that contact moves."""

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.predict.contact.step.poses import gaps_of

RNG = np.random.default_rng(2)


def test_slip_counts_from_where_the_obstacle_has_carried_it():
    frames, places, stuck = Rotation.random(2, rng=RNG).as_matrix(), RNG.normal(size=(4, 3)), RNG.normal(size=(4, 3))
    then, now = (Rotation.random(3, rng=RNG) for _ in range(2))
    t_then, t_now, distance = RNG.normal(size=(3, 3)), RNG.normal(size=(3, 3)), RNG.normal(size=4)
    near, which = np.array([1, 2]), np.array([0, 2, 1, 0])
    poses = then.as_matrix(), t_then, now.as_matrix(), t_now
    for moves in (True, False):
        gaps = gaps_of(frames, places, near, which, stuck, distance, *poses, moves, 0.5)
        for gap, frame, patch in zip(gaps, frames, near, strict=True):
            o, begin = which[patch], stuck[patch]
            if moves:
                begin = now[o].apply(then[o].inv().apply(begin - t_then[o])) + t_now[o]
            np.testing.assert_allclose(gap, [distance[patch], *frame[1:] @ (places[patch] - begin)], atol=1e-14)
    assert not gaps_of(frames, places, near, which, stuck, distance, *poses, True, 0.0)[:, 1:].any()
