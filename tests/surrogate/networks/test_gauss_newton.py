"""A fit reaches its minimum, goes on where it was killed, and ends when it should."""

import numpy as np
import pytest

from cfem.surrogate.networks import gauss_newton
from cfem.surrogate.networks.gauss_newton import LeastSquaresState, minimise
from cfem.surrogate.networks.series_network import DerivativeResiduals, Network

DERIVATIVES = ((), (0,), (1,))


def residuals(m: int, seed: int, noise: float = 0.0, width: int = 12) -> DerivativeResiduals:
    """Of u = exp(x) cos(2 y), values and gradients."""
    rng = np.random.default_rng(seed)
    x, y = z = rng.uniform(-1, 1, (2, m))
    columns = [np.exp(x) * np.cos(2 * y), np.exp(x) * np.cos(2 * y), -2 * np.exp(x) * np.sin(2 * y)]
    targets = np.stack(columns, axis=1)[..., None] + noise * rng.standard_normal((m, 3, 1))
    return DerivativeResiduals(Network(2, width, 2, 1), z.T, DERIVATIVES, targets, np.ones((3, 1)))


def test_it_fits_a_smooth_function_to_many_digits():
    fitted, held_out = residuals(100, 0), residuals(10, 1)
    found = minimise(fitted, held_out, fitted.network.start(0), 200, 50)
    assert np.sqrt(found.best) < 1e-5
    assert np.isclose(held_out.square(found.best_theta) / held_out.count, found.best)
    training = [record["training"] for record in found.history]
    assert training == sorted(training, reverse=True) and len(training) == found.iteration


def test_acceleration_saves_iterations(monkeypatch):
    fitted = residuals(30, 0)
    with_it = minimise(fitted, None, fitted.network.start(0), 60, 60).best
    monkeypatch.setattr(gauss_newton, "LARGEST_ACCELERATION", 0.0)
    assert minimise(fitted, None, fitted.network.start(0), 60, 60).best > 10 * with_it


def test_a_killed_fit_goes_on_and_ends_as_if_it_had_not_been(tmp_path, monkeypatch):
    monkeypatch.setattr(gauss_newton, "CHECKPOINT_SECONDS", 0.0)
    fitted, held_out = residuals(30, 0), residuals(10, 1)
    start = fitted.network.start(0)
    whole = minimise(fitted, held_out, start, 20, 50)
    step, calls = gauss_newton._step, []

    def killed(*arguments):
        calls.append(1)
        if len(calls) == 8:
            raise KeyboardInterrupt
        return step(*arguments)

    monkeypatch.setattr(gauss_newton, "_step", killed)
    with pytest.raises(KeyboardInterrupt):
        minimise(fitted, held_out, start, 20, 50, tmp_path / "state.npz")
    assert LeastSquaresState.load(tmp_path / "state.npz").iteration == 7
    resumed = minimise(fitted, held_out, start, 20, 50, tmp_path / "state.npz")
    assert np.array_equal(resumed.best_theta, whole.best_theta) and resumed.history == whole.history
    again = minimise(fitted, held_out, start, 20, 50, tmp_path / "state.npz")
    assert len(calls) == 8 + 20 - 7 and np.array_equal(again.best_theta, whole.best_theta)


def test_it_keeps_the_best_by_the_held_out_rows_and_stops_when_that_is_old():
    fitted, held_out = residuals(12, 0, noise=0.1, width=20), residuals(10, 1)
    found = minimise(fitted, held_out, fitted.network.start(0), 500, 10)
    assert found.iteration == found.best_iteration + 10 < 500
    assert np.isclose(held_out.square(found.best_theta) / held_out.count, found.best)
