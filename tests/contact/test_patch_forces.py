"""By how much patches miss the law of contact, in mm."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.benchmark import benchmark

from cfem.contact.law.newton import modes_from, newton
from cfem.contact.law.sliding import StepBegin
from cfem.contact.patch_forces import balance, in_frames, lawful, turned, violation

a_problem = benchmark("contact_random").a_problem
MU, C = 0.5, np.diag([2.0, 1.0, 1.0])
STICK, SLIP = [1.0, 0.2, 0.3], [1.0, 0.3, 0.4]


def test_what_obeys_the_law_has_none():
    solved = 0
    for seed in range(20):
        problem = a_problem(seed)
        found, _ = newton(problem.W, problem.free, problem.mu)
        if found is not None:
            gap = (problem.free + problem.W @ found.ravel()).reshape(-1, 3)
            assert violation(found, gap, problem.W, problem.mu) < 1e-12 * np.abs(problem.W).max() * np.abs(found).max()
            solved += 1
    assert solved > 10


@pytest.mark.parametrize(
    ("force", "gap", "missed"),
    [
        ([0, 0, 0], [0.5, 3, 0], 0.0),  # open
        ([0, 0, 0], [-0.5, 0, 0], 0.5),  # within
        (STICK, [0.1, 0, 0], 0.1),  # pressed, yet open
        (STICK, [0, 1e-3, 0], 1e-3),  # sticks, yet slips
        (SLIP, [0, -0.3, -0.4], 0.0),  # slides against its friction
        (SLIP, [0, 4e-4, -3e-4], 5e-4),  # across it
        ([1.0, 0.6, 0], [0, 0, 0], 2.0 * 0.1),  # beyond its limit by 0.1 N
        ([-0.1, 0, 0], [0, 0, 0], 2.0 * 0.1),  # pulls
    ],
)
def test_what_misses_it_does_by_so_much(force, gap, missed):
    found = violation(np.array([force], float), np.array([gap], float), C, MU)
    assert found == pytest.approx(missed, rel=1e-3, abs=1e-15)


def test_of_forces_that_turn_those_of_flat_obstacles_do_not():
    rng = np.random.default_rng(2)
    root, turning = rng.normal(size=(12, 12)), np.zeros((4, 3, 3))
    C, B = root @ root.T, np.zeros((12, 12))
    turning[[0, 2]] = -0.01 * np.eye(3) + 0.002 * rng.normal(size=(2, 3, 3))
    for i in range(4):
        B[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = turning[i]
    answer, exact = turned(C, turning), np.linalg.inv(np.linalg.inv(C) - B)
    np.testing.assert_allclose(answer.compliance, exact, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(answer.turning, B @ exact, rtol=1e-8, atol=1e-10)
    assert turned(C, 100 * np.abs(turning)) is None


def drawn(pairs, patches=3, seed=4):
    """Frames (p, 3, 3), compliance (9, 9) mm/N of three patches under forces (3, 3) N, and gaps (p, 3) mm."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3 * patches, 3 * patches))
    frames, gaps = Rotation.random(pairs, rng=rng).as_matrix(), rng.uniform(-1.0, 0.2, (pairs, 3))
    return frames, root @ root.T + np.eye(3 * patches), gaps, rng.normal(size=(patches, 3))


@pytest.mark.parametrize("bodies", [False, True])
def test_forces_obey_the_law_where_they_move_the_patches(bodies):
    frames, C, gaps, forces = drawn(3)
    mobility = 0.5 * np.eye(9) if bodies else None
    found = balance(None, frames, C, gaps, forces, forces, MU, mobility)
    moved = found.step + (0.5 * (found.push - forces) if bodies else 0.0)
    now = gaps + (frames @ moved[..., None])[..., 0]
    assert violation(found.local, now, C, MU) < 1e-9 and found.local[:, 0].max() > 1e-3
    np.testing.assert_allclose(found.forces, forces + found.change)
    np.testing.assert_allclose(found.forces, found.push)
    np.testing.assert_allclose((frames @ found.push[..., None])[..., 0], found.local, atol=1e-12)


def test_along_a_step_forces_obey_the_law_from_where_the_patches_have_slid_to():
    """The law holds with slip from there, and not with that of the whole step; a step of one part has not slid."""
    frames, C, gaps, forces = drawn(3)
    gaps[:, 0], begin = -3.0, StepBegin(np.zeros((3, 3)), 0.1 * frames[:, 0])
    found = balance(None, frames, C, gaps, forces, forces, 0.1, begin=begin)
    assert np.linalg.norm(found.slid, axis=1).max() > 0.1
    assert (frames[:, 0] * found.slid).sum(axis=1) == pytest.approx(np.zeros(3), abs=1e-12)
    whole = gaps + (frames @ found.step[..., None])[..., 0]
    from_there = whole - (frames @ found.slid[..., None])[..., 0]
    assert violation(found.local, from_there, C, 0.1) < 1e-9 < 1e-3 < violation(found.local, whole, C, 0.1)
    once = balance(None, frames, C, gaps, forces, forces, 0.1, begin=replace(begin, parts=1))
    assert not once.slid.any()
    np.testing.assert_allclose(once.push, balance(None, frames, C, gaps, forces, forces, 0.1).push)


@pytest.mark.parametrize("known", [0.0, 1.0])
def test_patches_that_press_each_other_bear_opposite_forces(known):
    """The first pair is of patch 0 against 1, the second of 2 against what is still. known: share of the forces so far
    that the guess tells."""
    frames, C, gaps, _ = drawn(2)
    relative = np.array([[1.0, -1.0, 0.0], [0.0, 0.0, 1.0]])
    push = 0.01 * np.random.default_rng(5).normal(size=(2, 3))
    forces, push = relative.T @ push, known * push
    found = balance(relative, frames, C, gaps, forces, push, MU)
    np.testing.assert_allclose(found.forces[0], -found.forces[1])
    np.testing.assert_allclose(found.forces[[0, 2]], found.push)
    now = gaps + (frames @ (relative @ found.step)[..., None])[..., 0]
    flexibility = np.kron(relative, np.eye(3)) @ C @ np.kron(relative, np.eye(3)).T
    assert violation(found.local, now, flexibility, MU) < 1e-9 and found.local[:, 0].max() > 1e-3


def test_a_share_of_the_way_ends_between_the_guess_and_the_law():
    frames, C, gaps, forces = drawn(3)
    whole = balance(None, frames, C, gaps, forces, forces, MU)
    mean = (forces + whole.forces) / 2
    half = whole.with_forces(mean, mean, frames, MU)
    np.testing.assert_allclose(half.step, whole.step / 2)
    np.testing.assert_allclose((half.local[:, None] @ frames)[:, 0], mean)
    assert half.modes == modes_from(half.local, MU)


def test_without_pairs_all_forces_are_taken_off():
    _, C, _, forces = drawn(0)
    forces[1] = 0.0
    found = balance(np.zeros((0, 3)), np.zeros((0, 3, 3)), C, np.zeros((0, 3)), forces, np.zeros((0, 3)), MU)
    assert found.modes == () and found.push.shape == found.local.shape == (0, 3)
    np.testing.assert_array_equal(found.forces, np.zeros((3, 3)))
    np.testing.assert_allclose(found.step.ravel(), -C @ forces.ravel())


@pytest.mark.parametrize("bodies", [False, True])
def test_forces_that_turn_with_their_frames_miss_the_law_where_these_have_come_to(bodies):
    """Written out: three of four patches in another order; the second sticks, so that its force stays in the scene.
    Their places are those of `balance`'s compliance, with what rigid bodies move them by."""
    rng, places, sticks = np.random.default_rng(7), np.array([2, 0, 3]), np.array([False, True, False])
    root = rng.normal(size=(12, 12))
    frames, C = Rotation.random(3, rng=rng).as_matrix(), root @ root.T + np.eye(12)
    local, push, gaps = rng.normal(size=(3, 3)), rng.normal(size=(3, 3)), rng.normal(size=(3, 3))
    root = rng.normal(size=(9, 9))
    by_bodies = root @ root.T if bodies else np.zeros((0, 0))
    by_law, missed, moved, beyond = lawful(local, push, sticks, frames, gaps, C, places, by_bodies, MU)
    expected = np.where(sticks[:, None], push, (frames.transpose(0, 2, 1) @ local[..., None])[..., 0])
    np.testing.assert_allclose(by_law, expected, atol=1e-12)
    in_frame = (frames @ expected[..., None])[..., 0]
    assert beyond == pytest.approx((np.linalg.norm(in_frame[:, 1:], axis=1) - MU * in_frame[:, 0]).max())
    rows = (3 * places[:, None] + np.arange(3)).ravel()
    change, block = (expected - push).ravel(), C[np.ix_(rows, rows)]
    far = np.abs(C[:, rows] @ change).max()
    if bodies:
        far, block = far + np.abs(by_bodies @ change).max(), block + by_bodies
    assert moved == pytest.approx(far)
    assert missed == pytest.approx(violation(in_frame, gaps, block, MU)) and missed > 0.1


def test_the_problem_in_the_frames_has_the_energy_of_the_scene():
    """Forces do the same work in both, and at `start` the gaps are those that are given."""
    frames, C, gaps, start = drawn(3)
    W, free = in_frames(C, gaps, frames, start)
    np.testing.assert_allclose(W, W.T, atol=1e-12)
    np.testing.assert_allclose(W @ start.ravel() + free, gaps.ravel(), atol=1e-12)
    forces = np.random.default_rng(8).normal(size=(3, 3))
    in_scene = np.einsum("pab,pa->pb", frames, forces).ravel()
    assert forces.ravel() @ W @ forces.ravel() == pytest.approx(in_scene @ C @ in_scene)
    turned_first = np.einsum("pab,pb->pa", frames, (C @ in_scene).reshape(3, 3))
    np.testing.assert_allclose(W @ forces.ravel(), turned_first.ravel(), atol=1e-12)
