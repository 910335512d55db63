"""Elements and laws together: derivatives, patch test, rigid motion."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import box_body

from cfem.core.errors import InputError
from cfem.mechanics.assembly import make_pattern, symmetric_product
from cfem.mechanics.body import make_body, response, tangent, tangent_form, with_materials
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material, stress

every_element = pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS.keys())
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())


def solid(element, law, poisson=0.45, divisions=(2, 1, 1), distort=0.0):
    return box_body((2, 1, 1), divisions, element.name, law.name, 3.0, poisson, distort)


def bent(body, size=0.05, seed=0):
    return body.mesh.X + size * np.random.default_rng(seed).standard_normal(body.mesh.X.shape)


def difference(function, x, direction, h=2e-4):
    """Derivative of function along direction, fourth order."""
    near, far = (function(x + k * h * direction) - function(x - k * h * direction) for k in (1, 2))
    return (8 * near - far) / (12 * h)


@every_element
@every_law
def test_force_is_the_gradient_of_the_energy(element, law):
    body = solid(element, law)
    x = bent(body)
    direction = np.random.default_rng(1).standard_normal(x.shape)
    slope = difference(lambda y: response(body, y).energy, x, direction)
    assert (response(body, x).force * direction).sum() == pytest.approx(slope, rel=1e-8)


@every_element
@every_law
def test_tangent_is_the_gradient_of_the_force(element, law):
    body = solid(element, law)
    x = bent(body)
    pattern = make_pattern(len(x), [body.cells], np.array([], dtype=int))
    data = np.zeros(pattern.nnz)
    tangent(body, response(body, x), pattern.slots, data)
    direction = np.random.default_rng(1).standard_normal(x.shape)
    slope = difference(lambda y: response(body, y).force, x, direction)
    product = symmetric_product(pattern, data, direction.reshape(-1, 1)).reshape(-1, 3)
    np.testing.assert_allclose(product, slope, atol=1e-6 * np.abs(slope).max())


@every_element
@every_law
def test_the_form_of_the_tangent_is_the_second_derivative_of_the_energy(element, law):
    body = solid(element, law)
    x = bent(body)
    motions = np.random.default_rng(1).standard_normal((*x.shape, 2))
    form = tangent_form(body, response(body, x), motions)
    for column in range(2):
        slope = difference(lambda y: response(body, y).force, x, motions[..., column])
        np.testing.assert_allclose(form[:, column], np.einsum("nik,ni->k", motions, slope), rtol=1e-6)


def test_other_materials_make_the_body_that_they_would_have_made():
    first, second = (Material(LAWS["neo-hookean"], young, poisson) for young, poisson in ((1.0, 0.3), (2.0, 0.45)))
    mesh = box_body((2, 1, 1), (2, 1, 1)).mesh
    end = np.flatnonzero(mesh.X[mesh.cells, 0].min(axis=1) > 0.99)
    body = make_body(mesh, ELEMENTS["tet10p0"], first, [(end, first)])
    for materials in ((first, second), (second, first)):
        made = make_body(mesh, ELEMENTS["tet10p0"], materials[0], [(end, materials[1])])
        x = bent(body)
        assert response(with_materials(body, materials), x).energy == response(made, x).energy
    with pytest.raises(InputError, match="finite and positive"):
        with_materials(body, [first, Material(LAWS["neo-hookean"], -1.0, 0.3)])


@every_element
@every_law
def test_patch_test_on_a_distorted_mesh(element, law):
    """An affine motion gives the same stress everywhere: interior nodes feel no force (Irons)."""
    body = solid(element, law, divisions=(4, 3, 3), distort=0.3)
    F = np.array([[1.1, 0.2, 0.0], [-0.1, 0.95, 0.1], [0.05, 0.0, 1.05]])
    at = response(body, body.mesh.X @ F.T)
    interior = np.setdiff1d(np.arange(len(body.mesh.X)), body.mesh.facets)
    edge_force = np.abs(stress(law, F[None], 3.0, 0.45)).max() * 0.25
    assert len(interior) > 8
    assert np.abs(at.force[interior]).max() < 1e-12 * edge_force
    D = at.solids[0].D
    np.testing.assert_allclose(D, np.broadcast_to(F - np.eye(3), D.shape), atol=1e-12)


@every_element
@every_law
def test_rigid_motion_costs_nothing(element, law):
    body = solid(element, law)
    x = body.mesh.X @ Rotation.from_rotvec([0.4, -1.2, 2.0]).as_matrix().T + [5.0, -3.0, 1.0]
    at = response(body, x)
    assert at.energy < 1e-12 * 3.0 * 2.0
    assert np.abs(at.force).max() < 1e-12 * 3.0


@every_element
def test_internal_forces_balance_in_force_and_moment(element):
    body = solid(element, LAWS["neo-hookean"])
    x = bent(body)
    force = response(body, x).force
    size = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * size
    assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-12 * size * 2


@every_element
def test_inversion_and_nan_are_seen(element):
    body = solid(element, LAWS["neo-hookean"])
    mirrored = body.mesh.X * [-1.0, 1.0, 1.0]
    assert response(body, mirrored).min_J == pytest.approx(-1.0)
    assert not response(body, mirrored * np.nan).min_J > 0.0
