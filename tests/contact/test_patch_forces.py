"""By how much patches miss the law of contact, in mm."""

import numpy as np
import pytest
from support.benchmark import benchmark

from cfem.contact.law.newton import newton
from cfem.contact.patch_forces import turned, violation

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
