"""Networks of sines, whose derivatives are those of finite differences."""

import numpy as np
import pytest

from cfem.predict.kinds.energy_net import SineNetwork

N_A, N, WIDTH, OUTPUTS = 2, 3, 5, 2  # actuators, inputs with a parameter


def arrays(depth, seed=0):
    rng = np.random.default_rng(seed)
    made, width = {"to_box": rng.normal(size=(N, N))}, N
    for i in range(depth):
        made[f"e_weight_{i}"], made[f"e_bias_{i}"] = rng.normal(size=(WIDTH, width)), rng.normal(size=WIDTH)
        width = WIDTH
    return made | {"e_output": rng.normal(size=(width, OUTPUTS))}


def value(made, depth, s, q):
    h = made["to_box"] @ np.concatenate([s, q])
    for i in range(depth):
        h = np.sin(made[f"e_weight_{i}"] @ h + made[f"e_bias_{i}"])
    return h @ made["e_output"]


@pytest.mark.parametrize("depth", [1, 2, 3])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_value_slopes_and_curvatures(depth, order):
    made, s, q = arrays(depth), np.array([0.3, -0.5]), np.array([0.7])
    found = SineNetwork("e", made, order, N_A, OUTPUTS)(made["to_box"] @ np.concatenate([s, q]))
    f = lambda s: value(made, depth, s, q)  # noqa: E731
    h, steps = 1e-4, 1e-4 * np.eye(N_A)
    expected = [f(s)]
    if order:
        slopes = np.stack([(f(s + step) - f(s - step)) / (2 * h) for step in steps], axis=-1)
        expected.append(slopes.ravel())  # row by row
    if order == 2:
        pairs = zip(*np.triu_indices(N_A), strict=True)
        curved = [
            (f(s + a + b) - f(s + a - b) - f(s - a + b) + f(s - a - b)) / (4 * h**2)
            for a, b in ((steps[i], steps[j]) for i, j in pairs)
        ]
        expected.append(np.ravel(curved))
    np.testing.assert_allclose(found, np.concatenate(expected), atol=2e-6)


def test_many_states_at_once_are_each_alone():
    made = arrays(2)
    net, z = SineNetwork("e", made, 2, N_A, OUTPUTS), np.random.default_rng(3).normal(size=(2, 4, N))
    found = net(z)
    for i in range(2):
        for j in range(4):
            np.testing.assert_allclose(found[i, j], net(z[i, j]), atol=1e-12)
