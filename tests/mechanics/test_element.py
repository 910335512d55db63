from dataclasses import replace

import numpy as np
import pytest
from support.blocks import box

from cfem.mechanics.element import (
    ELEMENTS,
    HEX_CORNERS,
    barycentric_gradients,
    reference_gradients,
    shape,
    shape_derivatives,
)
from cfem.mechanics.mesh import TET_EDGES

NODES = {
    4: np.eye(4),
    10: np.vstack([np.eye(4), (np.eye(4)[TET_EDGES[:, 0]] + np.eye(4)[TET_EDGES[:, 1]]) / 2]),
    8: HEX_CORNERS,
}
every_kind = pytest.mark.parametrize("n_nodes", NODES)


def inside(n_nodes: int, count: int = 5) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.uniform(-1, 1, (count, 3)) if n_nodes == 8 else rng.dirichlet(np.ones(4), count)


@every_kind
def test_shape_functions_are_one_at_their_node_and_sum_to_one(n_nodes):
    np.testing.assert_allclose(shape(n_nodes, NODES[n_nodes]), np.eye(n_nodes), atol=1e-15)
    np.testing.assert_allclose(shape(n_nodes, inside(n_nodes)).sum(axis=1), 1.0)


@every_kind
def test_derivatives_against_differences(n_nodes):
    L = inside(n_nodes)
    for i in range(L.shape[1]):
        step = 1e-6 * np.eye(L.shape[1])[i]
        slope = (shape(n_nodes, L + step) - shape(n_nodes, L - step)) / 2e-6
        np.testing.assert_allclose(shape_derivatives(n_nodes, L)[:, :, i], slope, atol=1e-9)


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS.keys())
def test_gradients_reproduce_linear_functions_and_bubbles_integrate_to_zero(element):
    mesh = box((2, 1, 1), (3, 2, 2), element.name, distort=0.3)
    gradients, weights = reference_gradients(element, mesh.X, mesh.cells)
    slope = np.array([1.0, -2.0, 3.0])
    found = np.einsum("ma,mqad->mqd", (mesh.X @ slope)[mesh.cells], gradients[:, :, : element.n_nodes])
    np.testing.assert_allclose(found, np.broadcast_to(slope, found.shape), atol=1e-12)
    assert weights.sum() == pytest.approx(2.0, rel=1e-12)
    modes = np.einsum("mq,mqad->mad", weights, gradients[:, :, element.n_nodes :])
    np.testing.assert_allclose(modes, 0.0, atol=1e-15)


def test_barycentric_gradients_reproduce_linear_functions():
    X = np.random.default_rng(0).standard_normal((4, 3))
    slope = np.array([1.0, -2.0, 3.0])
    gradient = np.einsum("a,ad->d", X @ slope, barycentric_gradients(X, np.array([[0, 1, 2, 3]]))[0])
    np.testing.assert_allclose(gradient, slope, atol=1e-12)


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS.keys())
def test_quadrature_integrates_what_the_element_needs(element):
    """Exact integrals of barycentric monomials: a! b! c! d! 3! / (a+b+c+d+3)! (Zienkiewicz and Taylor); of xi^2 eta^2
    over the cube's mean 1/9."""
    if element.n_nodes == 8:
        assert (element.points[:, 0] ** 2 * element.points[:, 1] ** 2).mean() == pytest.approx(1 / 9)
        return
    degree = 1 if element.order == 1 else 2
    assert element.points.sum(axis=1) == pytest.approx(np.ones(len(element.points)))
    assert element.points[:, 0].mean() == pytest.approx(1 / 4)
    if degree == 2:
        assert (element.points[:, 0] ** 2).mean() == pytest.approx(1 / 10)
        assert (element.points[:, 0] * element.points[:, 1]).mean() == pytest.approx(1 / 20)


def test_without_its_bubbles_a_hexahedron_has_no_more_functions_than_nodes():
    mesh = box((1, 1, 1), (2, 1, 1), "hex8")
    plain = replace(ELEMENTS["hex8"], bubbles=0)
    gradients, _ = reference_gradients(plain, mesh.X, mesh.cells)
    assert gradients.shape == (2, 8, 8, 3)
