"""Self-contact: derivatives, rigid motion, and two pressed columns in closed form."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import block
from support.boundary_value import newton

from cfem.contact.surface.facing import facing
from cfem.mechanics import self_contact
from cfem.mechanics.assembly import make_pattern, symmetric_product
from cfem.mechanics.body import make_body, on_nodes, response, tangent_form, with_materials
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh
from cfem.mechanics.self_contact import POINTS, make_self_contact

every_element = pytest.mark.parametrize("element", ["tet4", "tet10", "tet10p0"])
GAP = 0.4
ONSET = 0.25


def columns(element, poisson=0.3, young=2.0):
    """Two boxes of 2 x 2 x 1 mm, their meshes unlike, one above the other."""
    order = ELEMENTS[element].order
    low, high = block((2, 2, 1), (2, 1, 1), order), block((2, 2, 1), (1, 2, 1), order)
    count, shift = len(low.X), [0, 0, 1 + GAP]
    X, cells, facets = (
        np.concatenate(pair)
        for pair in ((low.X, high.X + shift), (low.cells, high.cells + count), (low.facets, high.facets + count))
    )
    body = make_body(Mesh(X, cells, facets), ELEMENTS[element], Material(LAWS["neo-hookean"], young, poisson))
    pairs = facing(X, facets[:, :3], POINTS, 2 * GAP)
    return replace(body, contact=make_self_contact(X, facets, pairs, ONSET, body.shear))


def pressed(body, seed=0):
    """Nodes with the gap closed to a tenth, and shaken by a twentieth of it."""
    x = body.mesh.X + 0.05 * GAP * np.random.default_rng(seed).standard_normal(body.mesh.X.shape)
    x[body.mesh.X[:, 2] > 1.1, 2] -= 0.9 * GAP
    return x


def slope(function, x, direction, h=1e-4):
    near, far = (function(x + k * h * direction) - function(x - k * h * direction) for k in (1, 2))
    return (8 * near - far) / (12 * h)


def alone(contact, x):
    """Response of the contact, and its force on the nodes."""
    force = np.zeros_like(x)
    return self_contact.response(contact, x, force), force


@pytest.mark.parametrize("deep", [0.0, 0.3])
@every_element
def test_force_and_tangent_are_the_derivatives_of_the_energy(element, deep):
    body = columns(element)
    contact, x = body.contact, pressed(body)
    x[body.mesh.X[:, 2] > 1.1, 2] -= deep * GAP
    motions = np.random.default_rng(1).standard_normal((*x.shape, 2))
    (state, force), direction = alone(contact, x), 0.1 * motions[..., 0]
    assert len(state.pairs) > len(contact.nodes) / 4
    work = slope(lambda y: alone(contact, y)[0].energy, x, direction)
    assert (force * direction).sum() == pytest.approx(work, 1e-6)
    pattern = make_pattern(len(x), [contact.nodes], np.array([], dtype=int))
    data = np.zeros(pattern.nnz)
    self_contact.tangent(contact, state, pattern.slots[0], data)
    by_force = slope(lambda y: alone(contact, y)[1], x, direction)
    product = symmetric_product(pattern, data, direction.reshape(-1, 1)).reshape(-1, 3)
    np.testing.assert_allclose(product, by_force, atol=1e-5 * np.abs(by_force).max())
    both = motions.reshape(-1, 2)
    form = self_contact.tangent_form(contact, state, motions)
    np.testing.assert_allclose(form, both.T @ symmetric_product(pattern, data, both), rtol=1e-11)
    whole, without = response(body, x), response(replace(body, contact=None), x)
    assert whole.energy - without.energy == pytest.approx(state.energy)
    np.testing.assert_allclose(whole.force - without.force, force, atol=1e-12)
    more = tangent_form(body, whole, motions) - tangent_form(replace(body, contact=None), without, motions)
    np.testing.assert_allclose(more, form, rtol=1e-8)


@every_element
def test_nothing_pushes_across_an_open_gap_or_by_rigid_motion(element):
    body = columns(element)
    contact, x = body.contact, pressed(body)
    apart, force = alone(contact, body.mesh.X)
    assert apart.energy == 0.0 and not force.any() and len(apart.pairs) == 0
    assert tangent_form(body, response(body, body.mesh.X), x[..., None]).shape == (1, 1)
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
    (here, force), (there, turned) = alone(contact, x), alone(contact, x @ turn.T + [3.0, 1.0, -7.0])
    assert there.energy == pytest.approx(here.energy, 1e-12)
    np.testing.assert_allclose(turned, force @ turn.T, atol=1e-12 * np.abs(force).max())
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-14)  # action and reaction, and their moments
    np.testing.assert_allclose(np.cross(x, force).sum(axis=0), 0.0, atol=1e-13)


@every_element
def test_two_columns_bear_what_their_springs_in_series_do(element):
    """Without lateral strain and at Poisson's ratio 0, a column of height 1 has the modulus E; the gap closes to
    onset (1 - (p / touching)^(1/3)). Of walls so hard that strains are small."""
    young, touching, onset = 2.0, 2e-3, ONSET * GAP
    plain = columns(element, 0.0, young)
    body = replace(plain, contact=replace(plain.contact, touching=touching))
    X, held, push = body.mesh.X, np.ones(body.mesh.X.shape, dtype=bool), GAP - 0.4 * onset
    top, bottom = X[:, 2] > 2 + GAP - 1e-9, X[:, 2] < 1e-9
    held[~(top | bottom), 2] = False
    start = X.copy()
    start[X[:, 2] > 1.1, 2] -= push
    x = newton(body, start, held, np.zeros_like(X))
    pressure = -response(body, x).force[top, 2].sum() / 4
    closed = GAP - onset * (1 - np.cbrt(pressure / touching)) + 2 * pressure / young
    assert pressure > 0.2 * touching
    assert closed == pytest.approx(push, abs=1e-3 * GAP)


def test_another_rest_or_material_has_other_gaps_and_pressures():
    body = columns("tet10")
    raised = body.mesh.X + np.where(body.mesh.X[:, 2:] > 1.1, [[0.0, 0.0, GAP]], 0.0)
    np.testing.assert_allclose(
        on_nodes(body, replace(body.mesh, X=raised)).contact.onset, 2 * body.contact.onset, rtol=1e-9
    )
    harder = with_materials(body, [Material(LAWS["neo-hookean"], 6.0, 0.3)])
    assert harder.contact.touching == pytest.approx(3 * body.contact.touching)


@pytest.mark.parametrize(
    "closing, to, part",
    [
        (-8.0, 12.0, 0.5),
        (0.0, 2.0, 1.0),  # no deeper than may be
        (1.9, 4.0, self_contact.LEAST),
        (2.5, 4.0, 1.0),  # which were as deep before
    ],
)
def test_a_step_ends_where_the_deepest_pair_overlaps_by_its_onset(closing, to, part):
    contact = columns("tet4").contact
    gaps = [contact.onset * (1 - value) for value in (closing, to)]
    for gap in gaps:
        gap[1:] = 20 * contact.onset[1:]  # all but one stay apart
    assert self_contact.step_until_deep(contact, *gaps) == pytest.approx(part)
