"""What follows the last known order of a module under loads, against bodies whose every order is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.predict.loads.wrench_series import Held
from cfem.predict.rows.load_error import BEYOND, FITTED, GUESSED, TURNED, module_error, third_order

COMPLIANCE, CRITICAL = 5.0, 0.8  # mm/N, N
UNITS = np.repeat([40.0, 1.0], 3)


def column(w, with_E):
    """A column along x that bends in y: e_y = C w_y h and e_x = C w_y^2 h^2 / (2 w_c), h = 1 / (1 - w_x / w_c). Along x
    and where it turns it is held: no C tells that w_x matters. Its orders in w = (w_x, w_y, ...)."""
    C, D, E = (np.zeros((1, *[6] * axes)) for axes in (2, 3, 4))
    C[0, 1, 1] = COMPLIANCE
    for axes in ((0, 1, 1), (1, 0, 1), (1, 1, 0)):
        D[0, *axes] = COMPLIANCE / CRITICAL
    for axes in ((0, 0, 1, 1), (0, 1, 0, 1), (0, 1, 1, 0), (1, 0, 0, 1), (1, 0, 1, 0), (1, 1, 0, 0)):
        E[0, *axes] = 2 * COMPLIANCE / CRITICAL**2
    curvature = SimpleNamespace(watched=6, square=lambda w: E[0] @ w @ w / 2, cubic=lambda w: E @ w @ w @ w / 6)
    module = Held(np.zeros(1), np.zeros((1, 6)), C, D, 0, curvature if with_E else None)
    return module, [C[0] @ w, D[0] @ w @ w / 2, E[0] @ w @ w @ w / 6][: 2 + with_E]


def test_the_third_order_of_a_column_is_exact():
    w = np.array([0.2, 0.03, 0.01, 0.5, -0.4, 0.3])
    module, (_, second) = column(w, False)
    share = w[0] / CRITICAL
    along = COMPLIANCE * w[1] ** 2 * share / CRITICAL
    expected = [along, COMPLIANCE * w[1] * share**2, 0, 0, 0, 0]
    np.testing.assert_allclose(third_order(module, w, second, UNITS), expected, rtol=1e-12)


def test_it_does_not_depend_on_the_unit_of_length():
    """Nor does what is held: compliances of 1 mm/N and of 0.001 rad/(N mm) are alike in a module of 40 mm."""
    rng, w = np.random.default_rng(0), np.array([0.2, 0.03, 0.01, 0.5, -0.4, 0.3])
    root = rng.normal(size=(6, 6))
    scale = np.repeat([1e-3, 1.0], 3)  # mm to m
    C, D = root @ root.T * UNITS * UNITS[:, None], rng.normal(size=(6, 6, 6)) * UNITS[:, None, None]
    module = Held(np.zeros(1), np.zeros((1, 6)), C[None], D[None], 0)
    metres = Held(
        module.psi,
        module.e,
        (C * scale * scale[:, None])[None],
        (D * scale * scale[:, None] * scale[:, None, None])[None],
        0,
    )
    found = third_order(module, w, D @ w @ w / 2, UNITS)
    w_m = w / scale
    again = third_order(metres, w_m, metres.D[0] @ w_m @ w_m / 2, UNITS * scale)
    np.testing.assert_allclose(again, found * scale, rtol=1e-9)


def test_the_error_of_a_module_is_the_sum_of_what_each_row_carries():
    """Of what follows beside what it has guessed of that, of rotations, and of what the model of C and D is off, more
    where it extrapolates."""
    w = np.array([0.2, 0.03, 0.0, 0.0, 0.0, 0.0])
    module, (first, second) = column(w, False)
    carried, length = np.tile([[1.0], [0.0], [2.0]], 6), np.sqrt(5.0)

    def error(guessed, errors, extrapolation):
        next_order = third_order(module, w, second, UNITS)
        moved = module.C[0] @ w + second + guessed * next_order
        return module_error(module, w, moved, carried, UNITS, errors, extrapolation), np.abs(next_order).sum()

    for guessed in (0.0, 0.5, 1.0, 1.5):
        found, size = error(guessed, {}, 1.0)
        assert found == pytest.approx(length * (abs(1 - guessed) + GUESSED * guessed) * size)
    off = {"frame_loss": 1e-4, "of_loads": {"dC": {"everywhere": 0.5, "factor": 0.1, "power": 2.0}}}
    least = length * GUESSED * error(1.0, {}, 1.0)[1]
    more = length * (0.02 * np.abs(first).sum() + FITTED * 0.4 * np.abs(second).sum())
    assert error(1.0, off, 2.0)[0] == pytest.approx(least + more)
    module.C[0, 3, 1] = module.C[0, 1, 3] = 0.1
    turned = TURNED * (0.1 * w[1]) ** 2 * length * np.abs(module.C[0] @ w).sum()
    found, size = error(1.0, {}, 1.0)
    assert found == pytest.approx(length * GUESSED * size + turned)


def test_with_E_it_is_all_that_the_approximant_guesses_and_what_E_is_off():
    w, errors = np.array([0.2, 0.03, 0.0, 0.0, 0.0, 0.0]), {"everywhere": 0.5, "factor": 0.1, "power": 2.0}
    (module, orders), carried = column(w, True), np.tile([[1.0], [0.0], [2.0]], 6)
    beyond, length = module.under(w).e - sum(orders), np.sqrt(5.0)
    share = w[0] / CRITICAL
    assert beyond[1] == pytest.approx(COMPLIANCE * w[1] * share**3 / (1 - share))
    found = module_error(module, w, module.under(w).e, carried, UNITS, {"of_loads": {"d2C": errors}}, 2.0)
    assert found == pytest.approx(length * (BEYOND * np.abs(beyond).sum() + FITTED * 0.4 * np.abs(orders[2]).sum()))


def test_a_model_that_states_no_bounds_has_to_be_trained_again():
    module, orders = column(np.array([0.2, 0.03, 0, 0, 0, 0]), False)
    with pytest.raises(InputError, match="does not bound its error under loads"):
        module_error(module, np.ones(6), sum(orders), np.ones((3, 6)), UNITS, {"of_loads": {"dC": 0.02}}, 1.0)
