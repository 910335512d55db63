"""States at given forces, against the energy that they are states of."""

import numpy as np
from surrogate.synthetic import energy, rows_of

from cfem.condensed import Condensed
from cfem.predict.dual_state import dual_states


class Robots:
    """The synthetic robot's states, counting evaluations."""

    def __init__(self):
        self.evaluated = 0

    def __call__(self, delta_a, which):
        self.evaluated += len(which)
        _, gradient, hessian = energy(delta_a)
        rows = rows_of(delta_a.shape[1])
        W = np.zeros((len(delta_a), rows.n, rows.n))
        W[:, rows.a, rows.a] = np.linalg.inv(hessian)
        free = np.zeros((len(delta_a), rows.n))
        free[:, rows.a] = delta_a - (W[:, rows.a, rows.a] @ gradient[..., None])[..., 0]
        return Condensed(rows, W, free, gradient)


def test_forces_are_found_from_a_poor_start():
    delta_a = np.random.default_rng(0).uniform(4.0, 14.0, (20, 2))
    wanted = energy(delta_a)[1]
    state, missing = dual_states(Robots(), "displacement", np.full((20, 2), 9.0), wanted, np.full(20, 1e-10))
    assert np.allclose(state, delta_a, atol=1e-9) and (missing <= 1e-10).all()


def test_a_state_that_has_come_home_is_not_asked_again():
    delta_a = np.array([[8.0, 8.0], [12.0, 5.0]])
    robots = Robots()
    start = np.array([[8.0, 8.0], [8.0, 8.0]])
    dual_states(robots, "displacement", start, energy(delta_a)[1], np.full(2, 1e-9))
    alone = Robots()
    dual_states(alone, "displacement", start[1:], energy(delta_a[1:])[1], np.full(1, 1e-9))
    assert robots.evaluated == 1 + alone.evaluated


def test_what_cannot_be_found_says_how_much_is_missing():
    def bounded(s, which):
        rows, size = rows_of(1), s / np.sqrt(1 + s**2)
        W = np.zeros((len(s), rows.n, rows.n))
        W[:, -1, -1] = (1 + s[:, 0] ** 2) ** 1.5
        free = np.zeros((len(s), rows.n))
        free[:, -1] = s[:, 0] - W[:, -1, -1] * size[:, 0]
        return Condensed(rows, W, free, size)

    state, missing = dual_states(bounded, "displacement", np.zeros((1, 1)), np.array([[2.0]]), np.array([1e-9]))
    assert np.isfinite(state).all() and 0.99 < missing[0] < 1.1
