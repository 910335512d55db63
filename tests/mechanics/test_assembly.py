import numpy as np
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from cfem.mechanics.assembly import add_blocks, make_pattern, symmetric_product


@given(seed=st.integers(0, 2**31), n=st.integers(4, 12), m=st.integers(1, 10), n_fixed=st.integers(0, 3))
@settings(max_examples=40, deadline=None)
def test_blocks_land_where_a_dense_assembly_puts_them(seed, n, m, n_fixed):
    rng = np.random.default_rng(seed)
    cells = np.array([rng.choice(n, 4, replace=False) for _ in range(m)])
    fixed = rng.choice(n, n_fixed, replace=False)
    clique = rng.choice(n, 3, replace=False)
    pattern = make_pattern(n, [cells, clique[None]], fixed)
    dense = np.zeros((n, 3, n, 3))
    data = np.zeros(pattern.nnz)
    groups = [(cell, pattern.slots[0][i]) for i, cell in enumerate(cells)] + [(clique, pattern.slots[1][0])]
    for nodes, slots in groups:
        block = rng.standard_normal((3 * len(nodes), 3 * len(nodes)))
        block = block + block.T
        add_blocks(block[None], slots[None], data)
        for a, node_a in enumerate(nodes):
            for b, node_b in enumerate(nodes):
                dense[node_a, :, node_b, :] += block[3 * a : 3 * a + 3, 3 * b : 3 * b + 3]
    free = np.setdiff1d(np.arange(n), fixed)
    expected = dense[free][:, :, free].reshape(3 * len(free), 3 * len(free))
    lower = sp.csc_array((data, pattern.indices, pattern.indptr), shape=expected.shape).toarray()
    np.testing.assert_allclose(lower, np.tril(expected), atol=1e-13)
    B = rng.standard_normal((3 * len(free), 2))
    np.testing.assert_allclose(symmetric_product(pattern, data, B), expected @ B, atol=1e-12)
