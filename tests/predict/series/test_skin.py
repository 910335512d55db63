"""The learned skin, made by hand: against NumPy's Chebyshev series, finite differences and static condensation."""

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebval

from cfem.condensed import Condensed, Rows
from cfem.core.errors import InputError
from cfem.predict.series.skin import LearnedSkin

N_A, K, M = 2, 3, 4  # actuators, modes, nodes of the surface
INDICES = np.array([[i, j] for i in range(4) for j in range(4 - i)])
S = np.array([0.4, -0.3])
NONE = np.zeros(0)


def value(series, indices, z):
    """Sums of products of Chebyshev polynomials."""
    terms = [np.prod([chebval(x, np.eye(4)[k]) for x, k in zip(z, row, strict=True)]) for row in indices]
    return series @ np.array(terms)


@pytest.fixture(scope="module")
def arrays():
    rng = np.random.default_rng(7)
    rest = rng.normal(size=(M, 3))
    compliance = np.zeros((K + K * (K + 1) // 2, len(INDICES)))  # of one effector row
    compliance[:, 0] = [0.1, 0.2, -0.1, 2.0, 0.3, 0.2, 2.5, 0.1, 3.0]
    compliance[:, 1:] = 0.02 * rng.normal(size=compliance[:, 1:].shape)
    return {
        "nodes": np.array([4, 1, 0, 3]),
        "rest": rest,
        "triangles": np.array([[0, 1, 2], [0, 2, 3]]),
        "weights": np.full(M, 0.25),
        "modes": rng.normal(size=(K, M, 3)),
        "to_box": np.array([[0.5, 0.1], [-0.2, 0.7]]),
        "offset": np.array([0.1, -0.2]),
        "indices": INDICES,
        "series": rng.normal(size=(K, len(INDICES))),
        "compliance_indices": INDICES,
        "compliance": compliance,
        "inner_nodes": np.array([5, 2]),
        "inner_rest": rng.normal(size=(2, 3)),
        "inner_modes": rng.normal(size=(K, 2, 3)),
    }


def skin(arrays, form="displacement"):
    return LearnedSkin(form, 1, N_A, N_A, arrays)


def in_box(arrays, s):
    return arrays["to_box"] @ s + arrays["offset"]


def packed(upper):
    full = np.zeros((K, K))
    full[np.triu_indices(K)] = upper
    return full + np.triu(full, 1).T


def test_rows_and_compliance_are_chebyshev_series_of_the_inputs(arrays):
    made, z = skin(arrays), in_box(arrays, S)
    np.testing.assert_allclose(made.rows(S, NONE), value(arrays["series"], INDICES, z), rtol=1e-12)
    expected = value(arrays["compliance"], INDICES, z)
    C_es, C_ss = made.compliance(S, NONE)
    np.testing.assert_allclose(C_es, expected[None, :K], rtol=1e-12)
    np.testing.assert_allclose(C_ss, packed(expected[K:]), rtol=1e-12)
    many = np.array([S, 2 * S])
    np.testing.assert_allclose(made.rows(many, np.zeros((2, 0))), [made.rows(one, NONE) for one in many], rtol=1e-12)
    np.testing.assert_allclose(made.rows(S, NONE), made.rows(many, np.zeros((2, 0)))[0], rtol=1e-12)  # kept, not old


def test_slopes_are_those_of_finite_differences(arrays):
    made, h = skin(arrays), 1e-6
    steps = [(S + h * one, S - h * one) for one in np.eye(N_A)]
    slope = np.stack([(made.rows(a, NONE) - made.rows(b, NONE)) / (2 * h) for a, b in steps], axis=-1)
    np.testing.assert_allclose(made.gradient(S, NONE), slope, atol=1e-8)
    ahead, behind = ([made.compliance(step[side], NONE) for step in steps] for side in (0, 1))
    for number, slopes in enumerate(made.compliance_slopes(S, NONE)):
        by_steps = [(a[number] - b[number]) / (2 * h) for a, b in zip(ahead, behind, strict=True)]
        np.testing.assert_allclose(slopes, by_steps, atol=1e-8)


def test_all_nodes_are_where_modes_put_them_in_the_order_of_the_mesh(arrays):
    made, rows = skin(arrays), np.array([0.3, -0.2, 0.5])
    expected = np.empty((6, 3))
    for where, rest, modes in (("nodes", "rest", "modes"), ("inner_nodes", "inner_rest", "inner_modes")):
        for place, node in enumerate(arrays[where]):
            moved = sum(row * mode[place] for row, mode in zip(rows, arrays[modes], strict=True))
            expected[node] = arrays[rest][place] + moved
    np.testing.assert_allclose(made.all_nodes(rows), expected, atol=1e-12)
    np.testing.assert_allclose(made.surface(rows), expected[arrays["nodes"]], atol=1e-12)
    both = made.all_nodes(np.array([rows, 2 * rows]))
    assert both.shape == (2, 6, 3)
    np.testing.assert_allclose(both[0], expected, atol=1e-12)


def test_nodes_that_are_missing_or_double_are_refused(arrays):
    without = {name: array for name, array in arrays.items() if not name.startswith("inner")}
    with pytest.raises(InputError, match="no nodes inside the body"):
        skin(without).all_nodes(np.zeros(K))
    with pytest.raises(InputError, match="others than the nodes that the surface leaves"):
        skin(arrays | {"inner_nodes": np.array([5, 1])}).all_nodes(np.zeros(K))


@pytest.mark.parametrize("form", ["displacement", "force"])
@pytest.mark.parametrize("softer", [1.0, 1.7])
def test_what_is_left_with_actuators_locked_or_driven_is_the_compliance(arrays, form, softer):
    """Static condensation of the joined W gives back what the skin says, and the state is where its rows are."""
    given = arrays if form == "displacement" else arrays | {"series": 0.1 * arrays["series"]}  # W stays positive
    made, rows, kept = skin(given, form), Rows(("tip",), ("a", "b")), [0, 4, 5]
    W_aa, lam = np.array([[3.0, 0.5], [0.5, 2.0]]), np.array([0.3, 0.2])
    W_ea = np.array([[0.4, -0.6]])
    W = np.block([[np.array([[4.0]]), W_ea], [W_ea.T, W_aa]])
    condensed = Condensed(rows, W, np.array([0.1, 0.2, 0.3]), lam)
    found = made.joined(condensed, S, NONE, softer)
    r, (C_es, C_ss), gradient = found.rows, made.compliance(S, NONE), made.gradient(S, NONE)
    np.testing.assert_allclose(found.W, found.W.T, atol=1e-12)
    np.testing.assert_allclose(found.W[np.ix_(kept, kept)], W, rtol=1e-9)
    W_sa, W_se, W_ss = (found.W[r.s, other] for other in (r.a, r.e, r.s))
    if form == "displacement":
        by_delta = np.linalg.solve(W_aa, W_sa.T).T
        np.testing.assert_allclose(by_delta, gradient, atol=1e-10)
        np.testing.assert_allclose(W_se - by_delta @ W_ea.T, softer * C_es.T, atol=1e-10)
        np.testing.assert_allclose(W_ss - by_delta @ W_sa.T, softer * C_ss, atol=1e-6)
    else:
        np.testing.assert_allclose(W_sa, softer * gradient, atol=1e-10)
        np.testing.assert_allclose(W_se, softer * C_es.T, atol=1e-10)
        assert np.linalg.eigvalsh(found.W).min() > -1e-9
    there = found.delta_free[r.s] + W_sa @ lam
    np.testing.assert_allclose(there, made.rows(S, NONE), atol=1e-12)
