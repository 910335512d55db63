"""Derivatives of a network by inputs and weights, against torch and finite differences."""

import numpy as np
import pytest
import torch

from cfem.surrogate.networks.series_network import DerivativeResiduals, Network

DERIVATIVES = ((), (0,), (1,), (2,), (0, 0), (0, 1), (1, 1), (0, 0, 0), (0, 0, 1), (0, 1, 1), (1, 1, 1))


def problem(derivatives=DERIVATIVES, depth: int = 2, m: int = 5, q: int = 2) -> tuple[DerivativeResiduals, np.ndarray]:
    """Three inputs, by the third of which only the first derivative is known."""
    rng = np.random.default_rng(0)
    network = Network(3, 7, depth, q)
    k = len(derivatives)
    targets, weights = rng.standard_normal((m, k, q)), rng.uniform(0.5, 2, (k, q))
    theta = network.start(1) + 0.3 * rng.standard_normal(network.size)
    return DerivativeResiduals(network, rng.uniform(-1, 1, (m, 3)), derivatives, targets, weights), theta


def by_torch(network: Network, theta: np.ndarray, z: torch.Tensor) -> torch.Tensor:
    *hidden, (output, constant) = [(torch.tensor(a), torch.tensor(b)) for a, b in network.layers(theta)]
    h = z
    for matrix, bias in hidden:
        h = torch.sin(matrix @ h + bias)
    products = torch.stack([z[i] * z[j] for i in range(len(z)) for j in range(i, len(z))])
    return output @ torch.cat([h, z, products]) + constant


@pytest.mark.parametrize("depth", [1, 2, 3])
def test_derivatives_by_inputs_equal_nested_autograd(depth):
    rng = np.random.default_rng(0)
    network = Network(3, 7, depth, 1)
    theta = network.start(1) + 0.3 * rng.standard_normal(network.size)
    z, zeros, ones = (
        rng.uniform(-1, 1, (4, 3)),
        np.zeros((4, len(DERIVATIVES), 1)),
        np.ones((len(DERIVATIVES), 1)),
    )
    found = DerivativeResiduals(network, z, DERIVATIVES, zeros, ones)(theta)[:, :, 0]
    for state, point in enumerate(z):
        x = torch.tensor(point, requires_grad=True)
        value = by_torch(network, theta, x)[0]
        gradient = torch.autograd.grad(value, x, create_graph=True)[0]
        hessian = [torch.autograd.grad(one, x, create_graph=True)[0] for one in gradient]
        for row, one in enumerate(DERIVATIVES):
            if len(one) == 0:
                expected = value
            elif len(one) == 1:
                expected = gradient[one[0]]
            elif len(one) == 2:
                expected = hessian[one[0]][one[1]]
            else:
                expected = torch.autograd.grad(hessian[one[0]][one[1]], x, retain_graph=True)[0][one[2]]
            assert np.isclose(found[row, state], expected.item(), rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize("derivatives", [((),), DERIVATIVES])
@pytest.mark.parametrize("depth", [1, 2])
def test_the_jacobian_equals_finite_differences(derivatives, depth, monkeypatch):
    residuals, theta = problem(derivatives, depth)
    monkeypatch.setattr("cfem.surrogate.networks.series_network.BLOCK", 1)  # one state at a time
    jacobian = np.concatenate(list(residuals.jacobian(theta)))
    flat = lambda at: residuals(at).swapaxes(0, 1).ravel()  # noqa: E731
    for column, direction in enumerate(np.eye(len(theta))):
        h = 1e-5
        expected = (flat(theta + h * direction) - flat(theta - h * direction)) / (2 * h)
        assert np.allclose(jacobian[:, column], expected, rtol=1e-6, atol=1e-7)


def test_normal_matrix_and_pull_back_are_those_of_the_jacobian():
    residuals, theta = problem()
    jacobian = np.concatenate(list(residuals.jacobian(theta)))
    r = residuals(theta)
    assert np.allclose(residuals.normal_matrix(theta), jacobian.T @ jacobian, rtol=1e-12, atol=1e-12)
    assert np.allclose(residuals.pull_back(theta, r), jacobian.T @ r.swapaxes(0, 1).ravel(), rtol=1e-11, atol=1e-11)
    assert np.isclose(residuals.square(theta), (r**2).sum())


def test_weights_are_those_of_their_layers():
    network = Network(2, 3, 2, 1)
    theta = np.arange(float(network.size))
    assert [matrix.shape for matrix, _ in network.layers(theta)] == [(3, 2), (3, 3), (1, 3 + 2 + 3)]
    assert (
        np.concatenate([part.ravel() for layer in network.layers(theta) for part in layer]).tolist() == theta.tolist()
    )
