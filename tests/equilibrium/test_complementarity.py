"""The active set against every set there is, judged by the raw conditions."""

from itertools import product

import numpy as np
import pytest

from cfem.equilibrium.complementarity import NoActiveSetError, change


def every_solution(S, gap, mu, unilateral):
    """Multipliers that satisfy the conditions, of all choices of rows that hold; rows scaled to a compliance of one, so
    that the tolerance means the same for each."""
    size, solutions = np.sqrt(np.abs(np.diag(S))), []
    S, gap, mu = S / np.outer(size, size), gap / size, mu * size
    for choice in product([False, True], repeat=len(gap)):
        held = np.array(choice) | ~unilateral
        total = np.zeros(len(gap))
        total[held] = np.linalg.solve(S[np.ix_(held, held)], (S @ mu - gap)[held])
        if (total[unilateral] >= -1e-10).all() and ((gap + S @ (total - mu))[~held] >= -1e-10).all():
            solutions.append(total / size)
    return solutions


def compliance(rng, m):
    B = rng.normal(size=(m, m + 2))
    return B @ B.T * np.outer(units := 10.0 ** rng.uniform(-2, 2, m), units)  # of cables and chambers


@pytest.mark.parametrize("m", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("pulling", [1.0, 0.6, 0.0])
def test_the_change_is_that_of_the_only_set_that_satisfies_the_conditions(m, pulling):
    rng = np.random.default_rng(m)
    for _ in range(40):
        S, unilateral = compliance(rng, m), rng.random(m) < pulling
        size = np.sqrt(np.diag(S))
        gap, mu = rng.normal(size=m) * size, np.where(unilateral, rng.random(m) / size, 0.0)
        guess = ~unilateral | (rng.random(m) < 0.5)
        dmu, held = change(S, gap, mu, unilateral, guess, 1e-12 * size)
        solutions = every_solution(S, gap, mu, unilateral)
        assert solutions
        for total in solutions:  # several sets only where a row just touches
            np.testing.assert_allclose((mu + dmu) * size, total * size, atol=1e-8)
        assert (mu + dmu)[~held].tolist() == [0.0] * int((~held).sum())


def test_a_row_that_just_touches_holds():
    S, gap = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-2.0, -1.0])
    dmu, held = change(S, gap, np.zeros(2), np.ones(2, bool), np.array([False, False]), np.full(2, 1e-12))
    assert held.all()
    np.testing.assert_allclose(dmu, [1.0, 0.0], atol=1e-15)


def test_of_two_rows_alike_the_shorter_one_holds_and_two_that_hold_depend_on_each_other():
    S, both = np.full((2, 2), 2.0), np.ones(2, bool)
    dmu, held = change(S, np.array([-3.0, -2.0]), np.zeros(2), both, both, np.full(2, 1e-12))
    assert held.tolist() == [True, False]
    np.testing.assert_allclose(dmu, [1.5, 0.0])
    with pytest.raises(np.linalg.LinAlgError, match="depend on each other"):
        change(S, np.array([-3.0, -3.0]), np.zeros(2), both, both, np.full(2, 1e-12))


def test_where_several_sets_solve_the_problem_the_one_that_held_stays():
    """A cable past its limit point, which yields the less the more it is drawn in: it pulls on, or all lets go."""
    S, gap, mu, one = np.array([[-2.0]]), np.array([-0.5]), np.array([1.0]), np.ones(1, bool)
    dmu, held = change(S, gap, mu, one, one, np.zeros(1))
    assert held.all() and mu + dmu == pytest.approx(0.75)
    assert len(every_solution(S, gap, mu, one)) == 2


def test_no_set_is_an_error():
    one = np.ones(1, bool)
    with pytest.raises(NoActiveSetError):
        change(np.array([[-2.0]]), np.array([-1.0]), np.zeros(1), one, one, np.zeros(1))
