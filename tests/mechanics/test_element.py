import numpy as np
import pytest

from cfem.mechanics.element import ELEMENTS, barycentric_gradients, shape, shape_derivatives
from cfem.mechanics.mesh import TET_EDGES

NODES = {
    1: np.eye(4),
    2: np.vstack([np.eye(4), (np.eye(4)[TET_EDGES[:, 0]] + np.eye(4)[TET_EDGES[:, 1]]) / 2]),
}


@pytest.mark.parametrize("order", [1, 2])
def test_shape_functions_are_one_at_their_node_and_sum_to_one(order):
    np.testing.assert_allclose(shape(order, NODES[order]), np.eye(len(NODES[order])), atol=1e-15)
    inside = np.random.default_rng(0).dirichlet(np.ones(4), 5)
    np.testing.assert_allclose(shape(order, inside).sum(axis=1), 1.0)


@pytest.mark.parametrize("order", [1, 2])
def test_derivatives_against_differences(order):
    L = np.random.default_rng(0).dirichlet(np.ones(4), 3)
    for i in range(4):
        step = 1e-6 * np.eye(4)[i]
        slope = (shape(order, L + step) - shape(order, L - step)) / 2e-6
        np.testing.assert_allclose(shape_derivatives(order, L)[:, :, i], slope, atol=1e-9)


def test_barycentric_gradients_reproduce_linear_functions():
    X = np.random.default_rng(0).standard_normal((4, 3))
    slope = np.array([1.0, -2.0, 3.0])
    gradient = np.einsum("a,ad->d", X @ slope, barycentric_gradients(X, np.array([[0, 1, 2, 3]]))[0])
    np.testing.assert_allclose(gradient, slope, atol=1e-12)


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS.keys())
def test_quadrature_integrates_what_the_element_needs(element):
    """Exact integrals of barycentric monomials: a! b! c! d! 3! / (a+b+c+d+3)! (Zienkiewicz and Taylor)."""
    degree = 1 if element.order == 1 else 2
    assert element.points.sum(axis=1) == pytest.approx(np.ones(len(element.points)))
    assert element.points[:, 0].mean() == pytest.approx(1 / 4)
    if degree == 2:
        assert (element.points[:, 0] ** 2).mean() == pytest.approx(1 / 10)
        assert (element.points[:, 0] * element.points[:, 1]).mean() == pytest.approx(1 / 20)
