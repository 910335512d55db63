import numpy as np
import pytest

from cfem.contact.law.modes import Mode, ModeStatus, modes_of, slip_equations, solve_mode, start_angles, with_angles
from cfem.contact.law.problem import ContactProblem


def test_the_jacobian_of_slip_is_the_derivative():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(9, 9))
    G, wrench = rng.normal(size=(9, 2)), rng.normal(size=2)
    problem = ContactProblem(root @ root.T, rng.normal(size=9), G, wrench, mu=0.5)
    modes = (Mode.SLIP, Mode.STICK, Mode.SLIP)
    y, h = rng.normal(size=(1, 15)), 1e-6
    _, J, by_free = slip_equations(problem, modes, y)
    ahead, behind = (slip_equations(problem, modes, y + sign * h * np.eye(15))[0] for sign in (1, -1))
    np.testing.assert_allclose(J[0], (ahead - behind).T / (2 * h), atol=1e-7)
    shift = rng.normal(size=9)
    moved = ContactProblem(problem.W, problem.free + shift, G, wrench, mu=0.5)
    change = slip_equations(moved, modes, y)[0] - slip_equations(problem, modes, y)[0]
    np.testing.assert_allclose(change[0], by_free @ shift, atol=1e-12)


def test_an_object_that_nothing_holds_is_reported_not_raised():
    G = np.array([[1.0], [0.0], [0.0]])
    pushed = ContactProblem(np.eye(3), np.ones(3), G, np.array([1.0]), mu=0.5)
    assert solve_mode(pushed, "coulomb", [Mode.OPEN]).status is ModeStatus.INCONSISTENT
    free = ContactProblem(np.eye(3), np.ones(3), G, np.array([0.0]), mu=0.5)
    found = solve_mode(free, "coulomb", [Mode.OPEN])
    assert found.status is ModeStatus.SINGULAR and found.valid


def test_a_rigid_wall_without_compliance_is_reported():
    problem = ContactProblem(np.zeros((3, 3)), np.array([-1.0, 0.5, 0.0]), mu=0.5)
    for mode in (Mode.STICK, Mode.SLIP):
        assert solve_mode(problem, "coulomb", [mode]).status is ModeStatus.INCONSISTENT


@pytest.mark.parametrize("count", range(1, 10))
def test_starts_are_spread_over_the_circles(count):
    angles = start_angles(count, quick=False)
    assert angles.shape[1] == count and len(angles) >= 12
    mean = np.exp(1j * angles).mean(axis=0)
    assert np.abs(mean).max() < 0.1


def test_starts_solve_the_equations_as_well_as_their_angles_allow():
    """The equations are linear in all but the angles: what is left of them is square on every other column."""
    rng = np.random.default_rng(2)
    root = rng.normal(size=(6, 6))
    problem = ContactProblem(root @ root.T, rng.normal(size=6), mu=0.5)
    modes, angles = (Mode.SLIP, Mode.STICK), start_angles(1, quick=True)
    y = with_angles(problem, modes, angles)
    F, J, _ = slip_equations(problem, modes, y)
    np.testing.assert_array_equal(y[:, 6:7], angles)
    fixed = np.delete(J, 6, axis=2)
    np.testing.assert_allclose(np.einsum("bij,bi->bj", fixed, F), 0.0, atol=1e-9)


def test_a_singular_jacobian_takes_the_step_of_least_norm_to_the_same_solutions(monkeypatch):
    W = np.diag([2.0, 1.0, 1.5])
    problem = ContactProblem(W, np.array([-1.0, 2.0, 0.3]), mu=0.4)
    regular = solve_mode(problem, "coulomb", [Mode.SLIP])

    def singular(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr(np.linalg, "solve", singular)
    least_norm = solve_mode(problem, "coulomb", [Mode.SLIP])
    assert regular.status is least_norm.status is ModeStatus.SOLVED and len(regular.lam)
    np.testing.assert_allclose(least_norm.lam, regular.lam, atol=1e-9)


@pytest.mark.parametrize("C", [np.eye(3), np.array([[2.0, 0.3, 0.1], [0.3, 1.5, -0.2], [0.1, -0.2, 1.0]])])
def test_points_at_one_place_share_the_force_that_one_alone_would_bear(C):
    """Who bears how much is undetermined: the least forces are halves."""
    free = np.array([-1.0, 0.2, -0.1])
    alone = solve_mode(ContactProblem(C, free), "bilateral", [Mode.STICK])
    both = solve_mode(ContactProblem(np.tile(C, (2, 2)), np.tile(free, 2)), "bilateral", [Mode.STICK] * 2)
    assert (alone.status, both.status) == (ModeStatus.SOLVED, ModeStatus.SINGULAR)
    np.testing.assert_allclose(both.lam, np.tile(alone.lam, 2) / 2, atol=1e-12)
    np.testing.assert_allclose(C @ alone.lam[0], -free, atol=1e-12)


def test_of_points_on_a_rigid_plate_the_least_forces_are_found():
    """The third is where the plate goes with 0.3 and 0.7 of the others: forces (0.3, 0.7, -1) f do nothing, so that the
    least ones have no part of them. By rounding the system is nearly regular."""
    root = np.random.default_rng(4).normal(size=(6, 6))
    plate = np.kron([[1.0, 0.0], [0.0, 1.0], [0.3, 0.7]], np.eye(3))
    problem = ContactProblem(plate @ root @ root.T @ plate.T, plate @ np.random.default_rng(5).normal(size=6))
    found = solve_mode(problem, "bilateral", [Mode.STICK] * 3)
    assert found.status is ModeStatus.SINGULAR
    np.testing.assert_allclose(problem.W @ found.lam[0], -problem.free, atol=1e-9)
    np.testing.assert_allclose([0.3, 0.7, -1.0] @ found.lam[0].reshape(3, 3), 0.0, atol=1e-9)


def test_equations_of_a_stiff_and_a_soft_direction_hold_to_rounding():
    """The inverse alone leaves rounding times the condition, 1e9."""
    Q = np.linalg.qr(np.random.default_rng(6).normal(size=(6, 6)))[0]
    W, lam = Q * np.logspace(0, -9, 6) @ Q.T, np.random.default_rng(7).normal(size=6)
    found = solve_mode(ContactProblem(W, -W @ lam), "bilateral", [Mode.STICK] * 2)
    assert found.status is ModeStatus.SOLVED
    np.testing.assert_allclose(W @ found.lam[0], W @ lam, atol=1e-13)


@pytest.mark.parametrize(
    ("law", "mu", "expected"),
    [
        ("coulomb", 0.0, (Mode.OPEN, Mode.SLIP)),
        ("coulomb", 1e-9, (Mode.OPEN, Mode.STICK, Mode.SLIP)),
        ("coulomb", 1.0, (Mode.OPEN, Mode.STICK, Mode.SLIP)),
        ("signorini", 1.0, (Mode.OPEN, Mode.SLIP)),
        ("bilateral", 0.0, (Mode.STICK,)),
    ],
)
def test_points_stick_where_there_is_friction_or_glue(law, mu, expected):
    assert modes_of(ContactProblem(np.eye(3), np.zeros(3), mu=mu), law) == expected
