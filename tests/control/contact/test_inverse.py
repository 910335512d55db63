from itertools import product

import numpy as np
import pytest

from cfem.contact import ContactProblem, Mode, solve_contact
from cfem.control.contact.inverse import contact_inverse
from cfem.control.contact.linearisation import ContactAim, ContactInverseStatus, ContactLinearisation
from cfem.control.inverse import Limits

OPEN = np.array([-np.inf, np.inf])


def random_case(seed: int, n_a: int, m: int, k: int = 0, cone: str = "exact", mu: float = 0.4):
    """Effectors, actuators and contacts of one positive definite compliance, coupled weakly enough for one contact
    state a load; the object, where there is one, is pressed on."""
    rng = np.random.default_rng(seed)
    n_e, n = 2, 2 + n_a + 3 * m
    root = rng.normal(size=(n, n))
    W = 0.3 * root @ root.T / n + np.eye(n)
    e, a, c = slice(0, n_e), slice(n_e, n_e + n_a), slice(n_e + n_a, n)
    W[a, c] += 0.5 * rng.normal(size=(n_a, 3 * m))
    W[c, a] = W[a, c].T
    free = rng.normal(size=n)
    free[c][::3] -= 0.5
    G = wrench = E = None
    if k:
        G = np.zeros((3 * m, 1))
        G[::3, 0], wrench, E = 1.0, np.array([0.8]), rng.normal(size=(n_e, 1))
    contact = ContactProblem(W[c, c], free[c], G, wrench, mu, cone, 4)
    return ContactLinearisation(W[e, a], W[e, c], W[a, a], W[a, c], free[e], free[a], contact, E)


def aim_of(seed: int, n_a: int) -> ContactAim:
    rng = np.random.default_rng(seed + 10**6)
    return ContactAim(2 * rng.normal(size=2), np.array([1.0, 0.5]), np.full(n_a, 0.05))


def cost_at(now, law, aim, limits, lambda_a) -> float:
    found = solve_contact(now.at(lambda_a), law)
    if not found.check.valid():
        return np.inf
    course = now.course(lambda_a, found.lam)
    low, high = limits.delta_a.T
    if (course < low).any() or (course > high).any():
        return np.inf
    return aim.cost(now.effectors(lambda_a, found.lam, found.xi), lambda_a)


def brute_force(now, law, aim, limits) -> float:
    """The least cost on a grid over the box of lambda_a, refined around its three best places."""
    low, high = limits.lambda_a.T
    n_a = len(low)
    per = 121 if n_a == 1 else 25
    axes = [np.linspace(a, b, per) for a, b in zip(low, high, strict=True)]
    places = [(cost_at(now, law, aim, limits, np.array(x)), x) for x in product(*axes)]
    best, step = np.inf, (high - low) / (per - 1)
    for cost, x in sorted(places)[:3]:
        centre, around = np.array(x), step
        for _ in range(7):
            near = [
                np.clip(centre + around * np.array(t), low, high) for t in product((-1, -0.5, 0, 0.5, 1), repeat=n_a)
            ]
            costs = [cost_at(now, law, aim, limits, each) for each in near]
            centre, around = near[int(np.argmin(costs))], around / 2
            cost = min(cost, *costs)
        best = min(best, cost)
    return best


@pytest.mark.parametrize(
    ("law", "cone", "n_a", "m", "k"),
    [
        ("bilateral", "exact", 2, 2, 1),
        ("signorini", "exact", 2, 2, 0),
        ("signorini", "exact", 2, 2, 1),
        ("coulomb", "exact", 1, 1, 0),
        ("coulomb", "exact", 1, 2, 1),
        ("coulomb", "exact", 2, 1, 0),
        ("coulomb", "pyramid", 2, 1, 0),
        ("coulomb", "pyramid", 1, 2, 1),
    ],
)
def test_no_place_of_a_fine_grid_is_better(law, cone, n_a, m, k):
    for seed in range(3):
        now, aim = random_case(seed, n_a, m, k, cone), aim_of(seed, n_a)
        limits = Limits(np.tile([0.0, 3.0], (n_a, 1)), np.tile([-2.0, 2.5], (n_a, 1)))
        found = contact_inverse(now, law, aim, limits)
        best = brute_force(now, law, aim, limits)
        if found.status is ContactInverseStatus.NONE:
            assert best == np.inf, seed
            continue
        assert found.check.valid()
        assert found.objective <= best + 1e-7 * (1 + best), (seed, found.modes)
        assert found.objective >= best - 1e-2 * (1 + best), (seed, found.modes)
        # And what it says is there is there: the contacts by themselves take that state.
        state = solve_contact(now.at(found.lambda_a), law, found.modes)
        assert np.abs(state.lam - found.lambda_c).max() < 1e-6
        assert (found.delta_a >= -2.0 - 1e-7).all() and (found.delta_a <= 2.5 + 1e-7).all()


def pusher(mu: float, cone: str = "exact") -> ContactLinearisation:
    """One actuator drags a pressed point along a wall (1 mm/N, pressed by 2 N); the effector is the point."""
    W_ac, free = np.array([[0.0, 0.6, 0.8]]), np.array([-2.0, 0.0, 0.0])
    contact = ContactProblem(np.eye(3), free, mu=mu, cone=cone)
    along = np.array([[0.0, 0.6, 0.8]])
    return ContactLinearisation(np.eye(1), along, np.eye(1), W_ac, np.zeros(1), np.zeros(1), contact)


@pytest.mark.parametrize("goal", [0.0, 0.4, 3.0])
def test_a_stuck_point_moves_once_friction_is_overcome(goal):
    """By hand: stuck up to 1 N; beyond, the effector moves by lambda_a - mu lambda_n."""
    aim = ContactAim(np.array([goal]), np.ones(1), np.full(1, 1e-4))
    found = contact_inverse(pusher(0.5), "coulomb", aim, Limits(np.array([[0.0, 10.0]]), OPEN[None]))
    expected = goal + 1.0 if goal else 0.0
    np.testing.assert_allclose(found.lambda_a, [expected], atol=1e-5)
    np.testing.assert_allclose(found.e, [goal], atol=1e-5)
    assert found.modes == ((Mode.SLIP,) if goal else found.modes)
    assert goal == 0 or found.lambda_c == pytest.approx([2.0, -0.6, -0.8], abs=1e-6)


def test_the_present_modes_and_their_neighbours_suffice_where_all_are_not_tried():
    for seed in range(3):
        now, aim = random_case(seed, 2, 2), aim_of(seed, 2)
        limits = Limits(np.tile([0.0, 3.0], (2, 1)), np.tile(OPEN, (2, 1)))
        all_of_them = contact_inverse(now, "signorini", aim, limits)
        some = contact_inverse(now, "signorini", aim, limits, [Mode.SLIP] * 2, exhaustive=False)
        assert some.status is ContactInverseStatus.SOLVED and some.objective >= all_of_them.objective - 1e-12
        again = contact_inverse(now, "signorini", aim, limits, all_of_them.modes, exhaustive=False)
        assert again.objective == pytest.approx(all_of_them.objective, rel=1e-9)


def test_bounds_that_no_state_keeps_are_reported():
    limits = Limits(np.array([[0.0, 1.0]]), np.array([[50.0, 60.0]]))
    found = contact_inverse(pusher(0.5), "coulomb", ContactAim(np.zeros(1), np.ones(1), np.ones(1)), limits)
    assert found.status is ContactInverseStatus.NONE
    assert np.isnan(found.lambda_a).all() and not found.check.valid()
