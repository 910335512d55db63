"""Robots that hold an object, against finite differences and the paper's formula."""

from dataclasses import dataclass

import numpy as np
import pytest

from cfem.condensed import Rows
from cfem.condensed.coupling import Coupled, Holder, RigidObject
from cfem.condensed.pose import Patch, from_energy, onto_patch
from cfem.core.errors import NumericalError

POINTS = np.array([[0.0, 2, 1], [1.7, 2, -1], [-1.7, 2, -1]])
HALF_TURN = np.diag([-1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Energy:
    """A robot of two actuators and three contact points: a quadratic, and cubic ridges of size `cubic`."""

    seed: int = 0
    cubic: float = 0.02
    stiff: float = 1.0
    scale: float = 1.0
    rows = Rows(("x",), ("a", "b"))

    def at_displacement(self, t):
        patch = Patch(POINTS, POINTS.mean(axis=0), len(t) == 8)
        d = np.concatenate([t[:2], patch.displacement(t[2:])])
        rng = np.random.default_rng(self.seed)
        root, ridges = rng.standard_normal((11, 11)), self.cubic * rng.standard_normal((3, 11))
        A = root @ root.T / 11 + self.stiff * np.eye(11)
        ridge = ridges @ d
        lam = A @ d + 3 * ridges.T @ ridge**2
        hessian = A + 6 * np.einsum("r,ri,rj->ij", ridge, ridges, ridges)
        rows = Rows(("x",), ("a", "b"), tuple(f"c{i}" for i in range(9)))
        lam, hessian = self.scale * lam, self.scale * hessian
        points = from_energy(rows, np.concatenate([[0.0], d]), lam, hessian, np.zeros((1, 11)), np.eye(1))
        return onto_patch(points, patch, t[2:])


def two_robots(
    turns=True, cubic=0.02, stiff=1.0, wrench=(0.1, -0.2, 0.05), updates=None, places=None, scale=1.0, oriented=False
):
    n = 6 if turns else 3
    places = places or [(np.eye(3), np.zeros(3)), (HALF_TURN, np.array([1.0, 9.0, 0.5]))]
    centre = places[0][0] @ np.array([0.2, 4.0, 0.1]) + places[0][1]
    held = RigidObject(centre, turns, np.concatenate([places[0][0] @ np.array(wrench), np.zeros(n - 3)]), oriented)
    origin = POINTS.mean(axis=0)
    holds = [
        Holder(f"r{i}", Energy(i, cubic, stiff, scale), 2, n, turn, shift, origin)
        for i, (turn, shift) in enumerate(places)
    ]
    return Coupled(holds, held, updates=updates)


DELTA = np.array([0.3, -0.2, 0.4, 0.1])


@pytest.mark.parametrize("turns", [True, False])
def test_the_whole_is_a_condensed_energy(turns):
    coupled, h = two_robots(turns), 1e-5
    at = coupled.at_displacement(DELTA)
    assert max(at.balance) <= 1e-10 and at.softest > 0
    steps = [[coupled.at_displacement(DELTA + s * step) for s in (1, -1)] for step in h * np.eye(4)]
    hessian = np.stack([(p.lambda_a - m.lambda_a) / (2 * h) for p, m in steps], axis=1)
    np.testing.assert_allclose(np.linalg.inv(at.W_aa), hessian, atol=1e-7)
    gradient = np.stack([(p.delta_e - m.delta_e) / (2 * h) for p, m in steps], axis=1)
    np.testing.assert_allclose(at.effector_jacobian, gradient, atol=1e-7)


def test_an_oriented_object_has_its_rotation_vector_for_an_effector_too():
    coupled, h = two_robots(oriented=True), 1e-5
    assert coupled.rows.effectors[3:] == ("object.rx", "object.ry", "object.rz")
    at = coupled.at_displacement(DELTA)
    np.testing.assert_allclose(at.delta_e, at.X, atol=1e-15)
    steps = [[coupled.at_displacement(DELTA + s * step).X for s in (1, -1)] for step in h * np.eye(4)]
    gradient = np.stack([(p - m) / (2 * h) for p, m in steps], axis=1)
    np.testing.assert_allclose(at.effector_jacobian, gradient, atol=1e-7)


def test_a_force_on_the_object_moves_it_by_the_compliance_of_the_whole():
    h, rows = 1e-5, []
    for axis in np.eye(3):
        p, m = (two_robots(wrench=np.array([0.1, -0.2, 0.05]) + s * h * axis).at_displacement(DELTA) for s in (1, -1))
        rows.append((p.delta_e - m.delta_e) / (2 * h))
    at = two_robots().at_displacement(DELTA)
    locked = at.W[:3, :3] - at.W_ea @ np.linalg.solve(at.W_aa, at.W_ea.T)
    np.testing.assert_allclose(locked, rows, atol=1e-7)


def test_turning_and_moving_the_scene_turns_and_moves_the_answer():
    turn, shift = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([3.0, -7, 2])
    places = [(np.eye(3), np.zeros(3)), (HALF_TURN, np.array([1.0, 9.0, 0.5]))]
    moved = [(turn @ one, turn @ other + shift) for one, other in places]
    here, there = two_robots().at_displacement(DELTA), two_robots(places=moved).at_displacement(DELTA)
    np.testing.assert_allclose(there.delta_e, turn @ here.delta_e, atol=1e-11)
    np.testing.assert_allclose(there.lambda_a, here.lambda_a, atol=1e-11)


def test_the_robots_push_the_object_against_its_load():
    at = two_robots().at_displacement(DELTA)
    np.testing.assert_allclose(at.forces.sum(axis=0), [-0.1, 0.2, -0.05], atol=1e-9)


def test_the_object_balances_to_the_stated_share_of_what_pushes_it():
    """Wherever the search has stopped: recomputed from the robots' own forces."""
    rng, coupled = np.random.default_rng(5), two_robots(cubic=0.1)
    for size in np.logspace(-3, -0.5, 15):
        at = coupled.at_displacement(DELTA + size * rng.standard_normal(4))
        left = np.linalg.norm(at.forces.sum(axis=0) + [0.1, -0.2, 0.05])
        assert left <= 1e-8 * np.linalg.norm(at.forces, axis=1).max()


def test_robots_ten_times_as_stiff_under_ten_times_the_load_do_the_same():
    one = two_robots().at_displacement(DELTA)
    ten = two_robots(scale=10.0, wrench=(1.0, -2.0, 0.5)).at_displacement(DELTA)
    np.testing.assert_allclose(ten.X, one.X, atol=1e-9)
    np.testing.assert_allclose(ten.forces, 10 * one.forces, atol=1e-8)
    assert ten.softest == pytest.approx(one.softest, rel=1e-6)


def test_one_update_of_linear_robots_is_the_papers_formula():
    """X = S J^T W_cc^-1 (W_ca lambda_a + delta_c_free - delta_c_before + J X_before) + S w of a guided object."""
    coupled = two_robots(turns=False, cubic=0.0, updates=1)
    before = coupled.at_displacement(np.zeros(4))
    at = coupled.at_displacement(DELTA)
    compliance, free, J = [], [], []
    for hold, part in zip(coupled.holds, before.parts, strict=True):
        i = coupled.holds.index(hold)
        W, a, c = np.linalg.inv(part.hessian), slice(2), slice(2, None)
        compliance.append(np.linalg.inv(W[c, c]))
        free.append(W[c, a] @ at.lambda_a[2 * i : 2 * i + 2] + (part.delta_a - W @ part.lambda_a)[c])
        J.append(hold.turn.T)
    X_before = before.X
    S = np.linalg.inv(sum(j.T @ K @ j for j, K in zip(J, compliance, strict=True)))
    pulled = sum(j.T @ K @ (one - j @ X_before + j @ X_before) for j, K, one in zip(J, compliance, free, strict=True))
    np.testing.assert_allclose(at.X, S @ (pulled + coupled.object.wrench), atol=1e-12)


def test_repeated_updates_end_where_newtons_method_does():
    once, full = two_robots(updates=1), two_robots().at_displacement(DELTA)
    for _ in range(8):
        at = once.at_displacement(DELTA)
    np.testing.assert_allclose(at.X, full.X, atol=1e-10)
    np.testing.assert_allclose(at.lambda_a, full.lambda_a, atol=1e-10)


def test_what_cannot_be_held_is_an_error():
    with pytest.raises(NumericalError, match="buckles"):
        two_robots(stiff=-3.0).at_displacement(DELTA)


def test_an_object_that_nobody_pushes_is_at_rest():
    """All forces vanish there, so that there is nothing for their sum to be small beside."""
    plain = two_robots(wrench=(0.0, 0.0, 0.0))
    at = plain.at_displacement(np.zeros(4))
    assert np.abs(at.X).max() < 1e-12 and max(at.balance) <= 1e-9
    noisy = two_robots(wrench=(0.0, 1e-12, 0.0)).at_displacement(np.zeros(4))
    assert noisy.updates <= 1
    stiff = two_robots(wrench=(0.0, 1e-10, 0.0), scale=1e4).at_displacement(np.zeros(4))
    assert stiff.updates == 0  # a force that moves the object by 1e-14 mm
