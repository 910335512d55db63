"""A contact problem in its own units."""

import numpy as np
import pytest

from cfem.contact.law.problem import ContactProblem
from cfem.core.errors import SpecError


def problem(compliance=2.0):
    rng = np.random.default_rng(3)
    root = rng.standard_normal((6, 6))
    W = compliance * (root @ root.T) / 6
    return ContactProblem(W, rng.standard_normal(6), 5 * rng.standard_normal((6, 3)), rng.standard_normal(3), 0.3)


def test_a_unit_motion_of_the_object_shifts_the_rows_by_one():
    np.testing.assert_allclose(np.linalg.norm(problem().normalised.motion, axis=0), 1.0, rtol=1e-14)


def test_forces_are_in_what_moves_the_softest_row_by_one_length():
    p = problem()
    normalised, u = p.normalised, p.units
    assert np.diag(normalised.W).max() == pytest.approx(1.0)
    lam, xi = np.array([0.3, -0.2, 0.1, 0.5, 0.0, 0.2]), np.array([0.1, -0.3, 0.2])
    gap = normalised.gap(lam / u.force, xi / u.motion)
    np.testing.assert_allclose(gap * u.length, p.gap(lam, xi), atol=1e-12)


def test_the_work_of_the_load_is_that_of_the_contact_forces():
    """G^T lambda = wrench in either unit."""
    p = problem()
    lam = np.linalg.lstsq(p.G.T, p.wrench, rcond=None)[0]
    np.testing.assert_allclose(p.normalised.motion.T @ (lam / p.units.force), p.normalised.load, atol=1e-12)


def test_without_compliance_the_gaps_are_the_unit_of_length():
    rigid = ContactProblem(np.zeros((3, 3)), np.array([0.5, -2.0, 0.1]))
    assert rigid.units.length == 2.0 and np.isfinite(rigid.units.force)


EYE, ONES = np.eye(6), np.ones(6)
REFUSED = {
    "no point": ((np.zeros((0, 0)), np.zeros(0)), {}, "three rows for every point"),
    "two rows": ((np.eye(2), np.ones(2)), {}, "three rows for every point"),
    "another W": ((np.eye(3), ONES), {}, "three rows for every point"),
    "G alone": ((EYE, ONES, np.ones((6, 2))), {}, "both G and wrench are needed"),
    "wrench alone": ((EYE, ONES, None, np.ones(2)), {}, "both G and wrench are needed"),
    "rows of G": ((EYE, ONES, np.ones((3, 2)), np.ones(2)), {}, r"G is \(3, 2\), 6 rows"),
    "columns of G": ((EYE, ONES, np.ones((6, 3)), np.ones(2)), {}, r"G is \(6, 3\), 6 rows and wrench \(2,\)"),
    "nan in W": ((EYE * np.nan, ONES), {}, "not finite"),
    "inf in free": ((EYE, ONES * np.inf), {}, "not finite"),
    "nan in G": ((EYE, ONES, np.full((6, 2), np.nan), np.ones(2)), {}, "not finite"),
    "nan in wrench": ((EYE, ONES, np.ones((6, 2)), np.array([np.nan, 1.0])), {}, "not finite"),
    "friction": ((EYE, ONES), {"mu": -0.1}, "friction"),
}


@pytest.mark.parametrize("arrays, options, message", REFUSED.values(), ids=REFUSED.keys())
def test_what_is_no_problem_is_refused(arrays, options, message):
    with pytest.raises(SpecError, match=message):
        ContactProblem(*arrays, **options)


def test_it_counts_its_points_and_the_motions_of_its_object():
    p = problem()
    assert (p.m, p.k) == (2, 3)
    assert ContactProblem(np.eye(3), np.ones(3)).k == 0
