"""Sections in a row: their frames, and moves that are linear in what they do to each other."""

import numpy as np
from scipy.spatial.transform import Rotation
from support.rods import rod_body

from cfem.mechanics.rod.region import response

BODY = rod_body(6)
ROW = BODY.sections


def test_frames_are_those_that_the_sections_were_moved_by():
    rng = np.random.default_rng(0)
    turns, shifts = Rotation.from_rotvec(rng.standard_normal((7, 3))), rng.standard_normal((7, 3))
    x = BODY.mesh.X.copy()
    x[ROW.nodes] = ROW.centres[:, None] + shifts[:, None] + ROW.arm @ turns.as_matrix().swapaxes(1, 2)
    c, R = ROW.frames(x)
    np.testing.assert_allclose(c, ROW.centres + shifts, atol=1e-12)
    np.testing.assert_allclose(R, turns.as_matrix(), atol=1e-12)


def test_an_advance_changes_the_strains_by_what_the_step_says_to_first_order():
    rng = np.random.default_rng(1)
    motions = np.vstack([np.zeros(6), rng.standard_normal((6, 6)) * [10, 10, 10, 0.5, 0.5, 0.5]])
    x = BODY.mesh.X.copy()
    x[ROW.nodes] = ROW.advanced(x, motions)
    before = response(BODY.rod, x)
    pairs = np.concatenate([motions[:-1], motions[1:]], axis=1)
    expected = before.strain.e + np.einsum("mij,mj->mi", before.strain.gradient, pairs)
    moved = x.copy()
    moved[ROW.nodes] = ROW.advanced(x, motions)
    np.testing.assert_allclose(response(BODY.rod, moved).strain.e, expected, atol=1e-10)
    np.testing.assert_allclose(moved[ROW.nodes[0]], x[ROW.nodes[0]], atol=1e-14)
