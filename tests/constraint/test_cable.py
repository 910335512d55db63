import re

import numpy as np
import pytest
from support.blocks import block

from cfem.constraint.attachment import attach
from cfem.constraint.cable import make_cable
from cfem.core.errors import SpecError

MESH = block((20, 10, 10), (4, 2, 2), order=2)
START, END = (attach(MESH, np.array(p), 2.0, "point") for p in ([2.0, 4, 5], [18.0, 4, 5]))


def test_shortening_of_a_compressed_body():
    assert make_cable([START, END], None, "cable").value(MESH.X * [0.9, 1, 1])[0] == pytest.approx(1.6, abs=1e-12)


def test_one_clique_a_segment():
    row = make_cable([START, END], np.array([-1.0, 5, 5]), "cable")
    assert [clique.shape[0] for clique in row.cliques] == [1, 1]
    assert set(row.cliques[0][0]) == set(START.nodes[START.weights != 0])
    assert set(row.cliques[1][0]) == set(row.nodes)


@pytest.mark.parametrize(
    "points, part",
    [
        ([START, START], "point 0 and point 1 coincide"),
        ([START], "cable 'left' needs two points"),
        ([], "needs two points"),
    ],
)
def test_bad_input_is_named(points, part):
    with pytest.raises(SpecError, match=re.escape(part)):
        make_cable(points, None, "left")


def test_the_form_of_the_curvature_is_that_of_its_blocks_and_of_second_differences():
    row, rng = make_cable([START, END], np.array([-1.0, 5, 5]), "cable"), np.random.default_rng(0)
    x, motions = MESH.X + rng.normal(scale=0.2, size=MESH.X.shape), rng.normal(size=(*MESH.X.shape, 3))
    form = row.curvature_form(x, motions)
    by_blocks = np.zeros((3, 3))
    for clique, blocks in zip(row.cliques, row.curvature(x), strict=True):
        mine = motions[clique].reshape(-1, 3)
        by_blocks += mine.T @ blocks[0] @ mine
    np.testing.assert_allclose(form, by_blocks, rtol=1e-12, atol=1e-14)
    h, v = 1e-3, motions[:, :, 0]
    second = (row.value(x + h * v)[0] - 2 * row.value(x)[0] + row.value(x - h * v)[0]) / h**2
    assert form[0, 0] == pytest.approx(second, rel=1e-4)
