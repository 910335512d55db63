import numpy as np
import pytest
from scipy.optimize import nnls
from support.all_modes import all_modes
from support.fast_cases import fast_are

from cfem.contact.law.check import check
from cfem.contact.law.modes import Mode
from cfem.contact.law.problem import ContactProblem
from cfem.contact.law.solve import ContactStatus, _search, solve_contact
from cfem.core.errors import SpecError


def random_problem(seed: int, m: int, k: int) -> ContactProblem:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3 * m, 3 * m + 1))
    scale = 10.0 ** rng.uniform(-3, 1)  # mm/N
    G, wrench = (rng.normal(size=(3 * m, k)), rng.normal(size=k) / scale) if k else (None, None)
    return ContactProblem(
        scale * root @ root.T / (3 * m),
        rng.normal(size=3 * m),
        G,
        wrench,
        float(rng.choice([0.2, 0.6, 2.0])),
    )


# seeds, points, coordinates of the object, law: 630 problems, of which those that cost little are fast
FEW = [
    (range(100), 1, 0, "signorini"),
    (range(100), 2, 1, "signorini"),
    (range(30), 3, 3, "signorini"),
    (range(50), 1, 0, "coulomb"),
    (range(15), 1, 2, "coulomb"),
    (range(10), 2, 0, "coulomb"),
    (range(2), 2, 3, "coulomb"),
    (range(1), 3, 0, "coulomb"),
]
MANY = [
    (range(30, 100), 3, 3, "signorini"),
    (range(50, 150), 1, 0, "coulomb"),
    (range(15, 100), 1, 2, "coulomb"),
    (range(10, 50), 2, 0, "coulomb"),
    (range(2, 15), 2, 3, "coulomb"),
    (range(1, 10), 3, 0, "coulomb"),
    (range(5), 3, 3, "coulomb"),
]


def test_a_search_tries_the_neighbours_at_points_that_violate_the_law_first():
    """Nearly three times as many systems, 217, where it begins with the others."""
    opened = (Mode.OPEN,) * 4
    seeds = [1, 2, 3, 4, 5, 7, 8, 9, 10, 11]  # the others have no state
    tried = [_search(random_problem(seed, 4, 0), "coulomb", opened, 400, True)[1] for seed in seeds]
    assert sum(tried) < 120, tried


@pytest.mark.parametrize(("seeds", "m", "k", "law"), fast_are(FEW, FEW + MANY))
def test_the_answer_is_one_of_all_or_none(seeds, m, k, law):
    for seed in seeds:
        problem = random_problem(seed, m, k)
        states = all_modes(problem, law)
        solution = solve_contact(problem, law)
        if not states:
            assert solution.status is ContactStatus.NONE, seed
            continue
        assert solution.status is ContactStatus.SOLVED, seed
        assert solution.check.valid() and check(problem, law, solution.lam, solution.xi).valid()
        force = np.abs(solution.lam).max() or 1.0
        assert min(np.abs(solution.lam - each.lam).max() for each in states) <= 1e-8 * max(1.0, force), seed


def block_gauss_seidel(problem: ContactProblem) -> np.ndarray | None:
    """lam by projecting each point's force on its cone again and again (Alart and Curnier's map); None where that
    does not converge."""
    lam = np.zeros(len(problem.free))
    steps = [0.3 / np.linalg.norm(problem.W[3 * i : 3 * i + 3, 3 * i : 3 * i + 3], 2) for i in range(problem.m)]
    for _ in range(4000):
        before = lam.copy()
        for i, step in enumerate(steps):
            at = slice(3 * i, 3 * i + 3)
            moved = lam[at] - step * (problem.W[at] @ lam + problem.free[at])
            normal = max(0.0, moved[0])
            friction = np.linalg.norm(moved[1:])
            limit = problem.mu * normal
            lam[at] = [normal, *(moved[1:] if friction <= limit else moved[1:] * limit / friction)]
        if np.abs(lam - before).max() < 1e-13 * max(1e-12, np.abs(lam).max()):
            return lam
    return None


@pytest.mark.parametrize("m", [1, 2])
def test_what_gauss_seidel_converges_to_is_among_all(m):
    converged = 0
    for seed in range(2000, 2012):
        problem = random_problem(seed, m, 0)
        lam = block_gauss_seidel(problem)
        if lam is None:
            continue
        converged += 1
        force = max(1e-12, np.abs(lam).max())
        assert min(np.abs(lam - each.lam).max() for each in all_modes(problem, "coulomb")) < 1e-7 * force, seed
    assert converged >= 6


@pytest.mark.parametrize("m", [1, 2, 3, 6])
def test_signorini_is_a_least_squares_problem(m):
    """min lam^T W lam / 2 + free^T lam over lam >= 0, by the factor of W and non-negative least squares."""
    for seed in range(20):
        problem = random_problem(seed, m, 0)
        normal = problem.W[::3, ::3]
        factor = np.linalg.cholesky(normal)
        expected = nnls(factor.T, -np.linalg.solve(factor, problem.free[::3]))[0]
        solution = solve_contact(problem, "signorini")
        assert solution.status is ContactStatus.SOLVED
        np.testing.assert_allclose(solution.lam[::3], expected, atol=1e-9 * max(1.0, expected.max()))
        assert not solution.lam.reshape(-1, 3)[:, 1:].any()


def test_strongly_coupled_points_have_an_odd_number_of_states():
    """With a positive definite W the states are the fixed points of a map of degree one (Brouwer), generic ones come
    in odd number: an even one tells of a missed state."""
    rng, several = np.random.default_rng(7), 0
    for trial in range(80):
        m = 1 + (trial % 4 == 3)
        root = rng.normal(size=(3 * m, 3 * m))
        root[:, 1::3] += 2 * root[:, 0::3]
        problem = ContactProblem(root.T @ root, rng.normal(size=3 * m), mu=5.0)
        states = all_modes(problem, "coulomb")
        assert len(states) % 2 == 1, trial
        assert all(each.check.valid() for each in states)
        several += len(states) > 1
    assert several > 4


def pressed(push: float) -> ContactProblem:
    """One point, 2 mm/N, pressed by 3 mm, its rest place moved `push` mm along a slanted direction of the plane."""
    return ContactProblem(2 * np.eye(3), np.array([-3.0, 0.6 * push, 0.8 * push]), mu=0.4)


@pytest.mark.parametrize("push", [0.0, 0.5, 1.19, 1.21, 4.0])
def test_a_pressed_point_sticks_until_the_push_exceeds_mu_n(push):
    solution = solve_contact(pressed(push), "coulomb")
    limit = 0.4 * 1.5
    friction = min(push / 2, limit)
    assert solution.modes == ((Mode.STICK,) if push / 2 < limit else (Mode.SLIP,))
    np.testing.assert_allclose(solution.lam, [1.5, -0.6 * friction, -0.8 * friction], atol=1e-12)


def test_strong_coupling_gives_three_states():
    """Sliding against the coupling presses harder the harder it presses: 1 - 0.8 mu < 0 (Painleve's paradox).

    By hand: slip lam = (1, -2), stick lam = -W^-1 free, open lam = 0."""
    W = np.array([[1.0, 0.8, 0.0], [0.8, 1.0, 0.0], [0.0, 0.0, 1.0]])
    problem = ContactProblem(W, np.array([0.6, 2.0, 0.0]), mu=2.0)
    states = all_modes(problem, "coulomb")
    found = {each.modes[0]: each.lam for each in states}
    assert len(states) == 3 and set(found) == set(Mode)
    np.testing.assert_allclose(found[Mode.SLIP], [1, -2, 0], atol=1e-12)
    np.testing.assert_allclose(found[Mode.STICK], -np.linalg.solve(W, problem.free), atol=1e-12)
    np.testing.assert_array_equal(found[Mode.OPEN], 0)
    for mode in Mode:
        assert solve_contact(problem, "coulomb", [mode]).modes == (mode,)


@pytest.mark.parametrize("law", ["signorini", "coulomb"])
def test_an_object_that_is_pulled_away_has_no_state(law):
    G, pull = np.array([[1.0], [0.0], [0.0]]), np.array([-1.0])
    problem = ContactProblem(np.eye(3), np.zeros(3), G, pull, mu=0.5)
    solution = solve_contact(problem, law)
    assert solution.status is ContactStatus.NONE
    assert np.isnan(solution.lam).all() and not solution.check.valid()


def test_an_object_on_three_points_shares_its_weight():
    """A disc on three equal springs: a third of the weight each, the object down by the springs' share."""
    angle = 2 * np.pi * np.arange(3) / 3
    G = np.zeros((9, 6))
    for i, (x, y) in enumerate(np.column_stack([np.cos(angle), np.sin(angle)])):
        G[3 * i] = [0, 0, 1, y, -x, 0]
        G[3 * i + 1] = [1, 0, 0, 0, 0, -y]
        G[3 * i + 2] = [0, 1, 0, 0, 0, x]
    # Along the springs' push the object carries 6 N; its coordinate falls where they shorten.
    problem = ContactProblem(0.5 * np.eye(9), np.zeros(9), G, np.array([0, 0, 6.0, 0, 0, 0]), mu=0.5)
    solution = solve_contact(problem, "coulomb")
    assert solution.status is ContactStatus.SOLVED
    np.testing.assert_allclose(solution.lam, np.tile([2.0, 0, 0], 3), atol=1e-12)
    np.testing.assert_allclose(solution.xi, [0, 0, 1.0, 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize("m", [6, 9])
def test_many_points_on_a_soft_plate_settle(m):
    rng = np.random.default_rng(m)
    places = rng.uniform(0, 10, (m, 2))
    decay = np.exp(-np.linalg.norm(places[:, None] - places, axis=2) / 3)
    W = np.kron(decay, np.diag([1.0, 0.5, 0.5])) + 0.05 * np.eye(3 * m)
    solution = solve_contact(ContactProblem(W, rng.normal(size=3 * m), mu=0.3), "coulomb")
    assert solution.status is ContactStatus.SOLVED and solution.check.valid()


def test_a_search_that_runs_out_says_so():
    G, pull = np.tile([[1.0], [0.0], [0.0]], (6, 1)), np.array([-1.0])
    problem = ContactProblem(np.eye(18), np.full(18, 0.1), G, pull, mu=0.5)
    assert solve_contact(problem, "coulomb", budget=5).status is ContactStatus.BUDGET


def test_bilateral_points_are_glued():
    problem = random_problem(3, 2, 2)
    solution = solve_contact(problem, "bilateral")
    np.testing.assert_allclose(problem.gap(solution.lam, solution.xi), 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "wrong", [{"W": np.eye(2)}, {"mu": -1.0}, {"wrench": np.zeros(2)}, {"free": np.full(3, np.nan)}]
)
def test_a_problem_that_does_not_fit_together_is_refused(wrong):
    with pytest.raises(SpecError, match="contact"):
        ContactProblem(**({"W": np.eye(3), "free": np.zeros(3)} | wrong))


@pytest.mark.parametrize(
    ("m", "budget", "limit", "quick"),
    [(2, 400, 9, False), (4, 400, 81, False), (5, 400, 243, False), (5, 20, 20, True), (8, 400, 400, False),
     (8, 7, 7, True), (9, 400, 20, True), (9, 7, 20, True)],
)  # fmt: skip
def test_a_search_tries_all_of_four_points_its_budget_of_eight_and_few_of_more(monkeypatch, m, budget, limit, quick):
    asked = []
    monkeypatch.setattr("cfem.contact.law.solve._pivot", lambda *_: (None, 3))
    monkeypatch.setattr("cfem.contact.law.solve._with_object", lambda *_: (None, 5))
    monkeypatch.setattr(
        "cfem.contact.law.solve._search", lambda problem, law, start, *how: asked.append(how) or (None, how[0])
    )
    found = solve_contact(random_problem(0, m, 3), "coulomb", budget=budget)
    assert asked == [(limit, quick)]
    assert found.tried == 3 + 5 * (m > 4) + limit
    assert found.status is (ContactStatus.NONE if limit == 3**m else ContactStatus.BUDGET)
    assert np.isnan(found.lam).all() and len(found.lam) == 3 * m and len(found.xi) == 3
