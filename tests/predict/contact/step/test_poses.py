"""Where bodies are that contact moves: how patches and soft pairs yield with them, and from where slip counts."""

import numpy as np
from scipy.spatial.transform import Rotation

from cfem.contact.rigid_bodies import RigidBodies
from cfem.predict.contact.step.poses import _gaps, _mobility

RNG = np.random.default_rng(2)


def test_patches_and_pairs_yield_as_their_levers_say():
    """Five patches of two robots, of which one stands still, on obstacles of which one stands still."""
    factor, places = RNG.normal(size=(12, 12)), RNG.normal(size=(5, 3))
    robots, obstacles, bodies, which = (np.array(each) for each in ([0, -1], [1, -1], [0, 0, 0, 1, 1], [1, 0, 0, 0, 1]))
    rigid = RigidBodies(RNG.normal(size=(2, 3)), factor @ factor.T, np.zeros(12), robots, obstacles)
    near, known, relative = np.array([1, 3, 4]), np.arange(5), np.array([[0.0, 1.0, 0.0, -0.25, -0.75]])
    G = rigid.levers(robots[bodies[near]], places[near]) - rigid.levers(obstacles[which[near]], places[near])
    pair = np.einsum("qc,cij->qij", relative, rigid.levers(robots[bodies], places))
    G = np.concatenate([G, pair]).reshape(12, 12)
    given = robots, bodies, obstacles, rigid.centres, rigid.mobility
    np.testing.assert_allclose(_mobility(places, near, which, known, relative, *given), G @ rigid.mobility @ G.T)


def test_slip_counts_from_where_the_obstacle_has_carried_it():
    frames, places, stuck = Rotation.random(2, rng=RNG).as_matrix(), RNG.normal(size=(4, 3)), RNG.normal(size=(4, 3))
    then, now = (Rotation.random(3, rng=RNG) for _ in range(2))
    t_then, t_now, distance = RNG.normal(size=(3, 3)), RNG.normal(size=(3, 3)), RNG.normal(size=4)
    near, which = np.array([1, 2]), np.array([0, 2, 1, 0])
    poses = then.as_matrix(), t_then, now.as_matrix(), t_now
    for moves in (True, False):
        gaps = _gaps(frames, places, near, which, stuck, distance, *poses, moves, 0.5)
        for gap, frame, patch in zip(gaps, frames, near, strict=True):
            o, begin = which[patch], stuck[patch]
            if moves:
                begin = now[o].apply(then[o].inv().apply(begin - t_then[o])) + t_now[o]
            np.testing.assert_allclose(gap, [distance[patch], *frame[1:] @ (places[patch] - begin)], atol=1e-14)
    assert not _gaps(frames, places, near, which, stuck, distance, *poses, True, 0.0)[:, 1:].any()
