import numpy as np
import pytest
from support.blocks import box_body

from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.load import gravity


@pytest.mark.parametrize("element", ELEMENTS)
def test_weight_and_its_moment_are_those_of_the_body(element):
    body = box_body((3, 2, 1), (3, 2, 1), element, distort=0.2)
    force = gravity(body, 2e-9, np.array([0.0, 0.0, -9810.0]))
    weight = 6.0 * 2e-9 * 9810.0
    np.testing.assert_allclose(force.sum(axis=0), [0, 0, -weight], rtol=1e-13, atol=1e-20)
    moment = np.cross(body.mesh.X, force).sum(axis=0)
    np.testing.assert_allclose(moment, np.cross([1.5, 1.0, 0.5], [0, 0, -weight]), rtol=1e-12, atol=1e-18)


def test_density_may_differ_from_cell_to_cell():
    body = box_body((2, 1, 1), (2, 1, 1))
    heavy = body.mesh.X[body.mesh.cells[:, :4]].mean(axis=1)[:, 0] > 1
    force = gravity(body, np.where(heavy, 3.0, 1.0), np.array([1.0, 0, 0]))
    assert force[:, 0].sum() == pytest.approx(4.0)
