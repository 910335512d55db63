"""Combined series of the modes against the skin's own functions."""

import numpy as np
import pytest

from cfem.core.errors import InputError
from cfem.predict.series.modes import ModeSeries, joined


def test_values_and_slopes_are_the_skin_s(model):
    skin, none = model.skin, np.zeros(0)
    rng = np.random.default_rng(0)
    T, at, w = rng.normal(size=(4, len(skin))), np.array([2.7]), np.array([0.01, -0.02, 0.03])
    y, by = ModeSeries.of(skin, 1, T, 3, np.array([0, 2, 4]))(at, w)  # tip.x, tip.z and the second mode
    C_es, C_ss = skin.compliance(at, none)
    C = np.column_stack([C_es[0], C_es[2], C_ss[:, 1]])
    assert y == pytest.approx(T @ (skin.rows(at, none) + C @ w))
    assert by[:, 1:] == pytest.approx(T @ C)
    ahead, behind = (
        T @ (skin.rows(at + h, none) + np.column_stack([*skin.compliance(at + h, none)[0][[0, 2]],
                                                        skin.compliance(at + h, none)[1][1]]) @ w)
        for h in (1e-5, -1e-5)
    )  # fmt: skip
    assert by[:, 0] == pytest.approx((ahead - behind) / 2e-5, rel=1e-6)


def test_without_loads_it_is_the_shape_alone(model):
    y, by = ModeSeries.of(model.skin, 1, np.eye(len(model.skin)), 3, np.array([], dtype=int))(
        np.array([1.5]), np.zeros(0)
    )
    assert y == pytest.approx(model.skin.rows(np.array([1.5]), np.zeros(0)))
    assert by == pytest.approx(model.skin.gradient(np.array([1.5]), np.zeros(0)))


def test_series_over_different_terms_are_joined():
    indices, series = joined(
        [(np.array([[0], [1]]), np.array([[1.0, 2.0]])), (np.array([[2], [0]]), np.array([[5.0, 7.0]]))]
    )
    assert indices.ravel().tolist() == [0, 1, 2]
    assert series[:, 0].tolist() == [[1, 2, 0], [7, 0, 5]]


def test_a_model_of_forces_is_refused(model):
    class Held:
        form, arrays = "force", model.skin.arrays

    with pytest.raises(InputError, match="form displacement"):
        ModeSeries.of(Held(), 1, np.eye(2), 3, np.array([0]))
