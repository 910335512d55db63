"""Derivatives of contact states, against differences of whole solutions."""

import numpy as np
import pytest

from cfem.contact.law.modes import Mode
from cfem.contact.law.problem import ContactProblem
from cfem.contact.law.sensitivity import sensitivity
from cfem.contact.law.solve import solve_contact

STEP = 1e-6


def pressed(mu, wrench):
    """A block on three points that yield differently, pressed and pushed along the surface."""
    rng = np.random.default_rng(5)
    A = rng.normal(size=(9, 9))
    W = A @ A.T / 9 + np.eye(9)
    arms = np.array([[1.0, 0.0], [-0.6, 0.8], [-0.5, -0.9]])
    G = np.zeros((9, 6))
    for i, (y, z) in enumerate(arms):
        G[3 * i : 3 * i + 3, :3] = np.eye(3)
        G[3 * i : 3 * i + 3, 3:] = [[0, z, -y], [-z, 0, 0], [y, 0, 0]]
    free = np.array([0.01, 0.02, 0, -0.02, 0, 0.01, 0, -0.01, 0.02])
    return ContactProblem(W, free, G, np.asarray(wrench, float), mu)


@pytest.mark.parametrize(
    ("mu", "push", "modes"),
    [
        (0.8, 0.2, {Mode.STICK}),
        (0.8, 0.75, {Mode.STICK, Mode.SLIP}),
        (0.8, -0.7, {Mode.STICK, Mode.SLIP}),
    ],
)
def test_forces_and_motion_change_as_whole_solutions_do(mu, push, modes):
    problem = pressed(mu, [3.0, 3.0 * push, 0.1, 0.05, 0.0, 0.1])
    at = solve_contact(problem, "coulomb")
    assert set(at.modes) == modes
    forces, motions = sensitivity(problem, at.modes, at.lam, at.xi)
    for row in range(9):
        ahead, behind = (solve_contact(pressed_at(problem, row, sign * STEP), "coulomb", at.modes) for sign in (1, -1))
        assert ahead.modes == behind.modes == at.modes
        np.testing.assert_allclose((ahead.lam - behind.lam) / (2 * STEP), forces[:, row], atol=2e-6)
        np.testing.assert_allclose((ahead.xi - behind.xi) / (2 * STEP), motions[:, row], atol=2e-6)


def pressed_at(problem, row, change):
    free = problem.free + change * np.eye(9)[row]
    return ContactProblem(problem.W, free, problem.G, problem.wrench, problem.mu)


def test_without_friction_the_normal_forces_alone_change():
    W, free = np.eye(6), np.array([-1.0, 0, 0, -0.5, 0, 0])
    W[0, 3] = W[3, 0] = 0.2
    problem = ContactProblem(W, free)
    at = solve_contact(problem, "signorini")
    forces, motions = sensitivity(problem, at.modes, at.lam, at.xi)
    expected = np.zeros((6, 6))
    expected[np.ix_([0, 3], [0, 3])] = -np.linalg.inv(W[np.ix_([0, 3], [0, 3])])
    np.testing.assert_allclose(forces, expected, atol=1e-12)
    assert motions.shape == (0, 6)
