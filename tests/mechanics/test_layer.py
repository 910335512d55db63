"""Layers that resist stretching alone: derivatives, rigid motion, and closed forms that they were not derived from."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import block, box_body
from support.boundary_value import newton

from cfem.core.errors import InputError
from cfem.mechanics.assembly import make_pattern, symmetric_product
from cfem.mechanics.body import make_body, on_nodes, response, tangent, tangent_form, with_layers, without
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.layer import Fabric, Fibres, make_layer
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh, boundary_facets, quadratic

FABRIC = Fabric(
    0.2, 30.0, 0.3, (Fibres(np.array([1.0, 0.2, 0.0]), 0.5, 80.0), Fibres(np.array([0.0, 1.0, 1.0]), 0.0, 9.0))
)
THREE = np.full((3, 3), 1 / 6) + np.eye(3) / 2  # the rule of degree 2
every_element = pytest.mark.parametrize("element", ["tet4", "tet10", "tet10p0"])


def where(mesh, axis, place):
    """The facets of the surface that lie in a plane."""
    return mesh.facets[(np.abs(mesh.X[mesh.facets][:, :, axis] - place) < 1e-9).all(axis=1)]


def layered(element):
    body = box_body((2, 1, 1), (2, 1, 1), element)
    return with_layers(body, [(where(body.mesh, 2, 0.0), FABRIC), (where(body.mesh, 1, 1.0), FABRIC)])


def bent(body, size=0.05, seed=0):
    return body.mesh.X + size * np.random.default_rng(seed).standard_normal(body.mesh.X.shape)


def slope(function, x, direction, h=1e-3):
    near, far = (function(x + k * h * direction) - function(x - k * h * direction) for k in (1, 2))
    return (8 * near - far) / (12 * h)


@every_element
def test_force_and_tangent_are_the_derivatives_of_the_energy(element):
    body = layered(element)
    x, motions = bent(body), np.random.default_rng(1).standard_normal((*body.mesh.X.shape, 2))
    state, direction = response(body, x), motions[..., 0]
    assert (state.force * direction).sum() == pytest.approx(
        slope(lambda y: response(body, y).energy, x, direction), 1e-8
    )
    pattern = make_pattern(len(x), [body.cells], np.array([], dtype=int))
    data = np.zeros(pattern.nnz)
    tangent(body, state, pattern.slots, data)
    by_force = slope(lambda y: response(body, y).force, x, direction)
    product = symmetric_product(pattern, data, direction.reshape(-1, 1)).reshape(-1, 3)
    np.testing.assert_allclose(product, by_force, atol=1e-6 * np.abs(by_force).max())
    np.testing.assert_allclose(
        tangent_form(body, state, motions)[:, 0], np.einsum("nik,ni->k", motions, by_force), rtol=1e-6
    )


def test_the_stress_of_the_last_step_is_exact_where_the_step_was_none():
    body, data = layered("tet10"), []
    state, pattern = response(body, bent(body)), make_pattern(len(body.mesh.X), [body.cells], np.array([], dtype=int))
    for before in (None, state):
        data.append(np.zeros(pattern.nnz))
        tangent(body, state, pattern.slots, data[-1], before)
    np.testing.assert_allclose(*data, rtol=1e-12, atol=1e-9)


def test_a_rigid_motion_strains_no_layer():
    body = layered("tet10")
    turned = body.mesh.X @ Rotation.from_rotvec([1.0, 2.0, -0.5]).as_matrix().T + [3.0, 0.0, -1.0]
    state = response(body, turned)
    assert state.energy < 1e-13 and np.abs(state.force).max() < 1e-11


def test_a_uniform_stretch_stores_what_fibres_and_plane_stress_say():
    """Fibres at an angle a from x are stretched to sqrt(c^2 l1^2 + s^2 l2^2); the rest by hand from Hooke's law."""
    body, angle, young = box_body((2, 1, 1), (2, 1, 1), "tet10"), 0.4, 7.0
    stretch = np.array([1.2, 0.9, 1.0])
    along = (np.cos(angle) ** 2 * 1.44 + np.sin(angle) ** 2 * 0.81 - 1) / 2
    exx, eyy = (stretch[:2] ** 2 - 1) / 2
    plane = 5.0 / (2 * (1 - 0.3**2)) * (exx**2 + eyy**2 + 2 * 0.3 * exx * eyy)
    plain = response(body, body.mesh.X * stretch).energy
    for facets in (where(body.mesh, 2, 1.0), where(body.mesh, 2, 0.0)):  # seen from either side
        turn = angle if facets is not None and body.mesh.X[facets][0, 0, 2] > 0.5 else -angle
        fabric = Fabric(0.1, 5.0, 0.3, (Fibres(np.array([3.0, 0.0, 0.0]), turn, young),))
        made = with_layers(body, [(facets, fabric)])
        stored = response(made, body.mesh.X * stretch).energy - plain
        assert stored == pytest.approx(2 * 0.1 * (young / 2 * along**2 + plane), rel=1e-10)


def curl(element, divisions, ratio, turn, points=None):
    """By how much a strip of 20 x 2 x 0.5 mm with a shorter layer below it turns, over `turn`: what Timoshenko's strip
    of two layers (J. Opt. Soc. Am. 11, 1925) does with that mismatch, one layer so thin that E t alone counts, `ratio`
    of the strip's. kappa = 6 N / (E h^2), N (1 / (E1 t1) + 4 / (E h)) = mismatch."""
    length, h = 20.0, 0.5
    mesh = block((length, 2.0, h), divisions, ELEMENTS[element].order)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["st-venant-kirchhoff"], 1.0, 0.0))
    mismatch = turn / length * h**2 / 6 * (1 / (ratio * h) + 4 / h)
    fabric, facets = Fabric(0.01, ratio * h / 0.01, 0.0), where(mesh, 2, 0.0)
    options = {} if points is None else {"points": points}
    layer = make_layer(mesh.X * [1 - mismatch, 1, 1], body.cells, facets, fabric, **options)
    low = np.abs(mesh.X) < 1e-9
    held = np.stack([low[:, 0], low[:, 0] & low[:, 1], low[:, 0] & low[:, 2]], axis=1)
    x = newton(replace(body, layers=(layer,)), mesh.X, held, np.zeros_like(mesh.X), 1e-6, predicted=True)
    end, below = mesh.X[:, 0] > length - 1e-9, low[:, 2]
    up = x[end & (mesh.X[:, 2] > h - 1e-9)].mean(axis=0) - x[end & below].mean(axis=0)
    return float(np.arctan2(up[0], up[2])) / turn


@pytest.mark.parametrize("ratio", [1.0, 100.0])
def test_a_strip_of_two_layers_curls_as_timoshenko_says(ratio):
    assert curl("tet10", (20, 1, 1), ratio, 0.5) == pytest.approx(1.0, abs=0.01)


def test_a_stiff_layer_lets_quadratic_elements_bend_and_locks_three_points_and_linear_ones():
    """A turn of 86 degrees over five or ten elements, under a layer 10 000 times as stiff as the strip."""
    assert curl("tet10", (10, 1, 1), 1e4, 1.5) > 0.97
    assert curl("tet10", (5, 1, 1), 1e4, 1.5) > 0.93
    assert curl("tet10", (5, 1, 1), 1e4, 1.5, THREE) < 0.5
    assert curl("tet4", (10, 1, 1), 1e4, 1.5) < 0.5


RADIUS, WALL, SOFT = 10.0, 0.5, 1.0  # mm, mm, MPa


def tube(fabric, pressure):
    """A quarter of a soft tube with a layer outside, held at both ends along it, under a pressure inside: the radial
    displacement (mm) of the layer, and the force (N) by which the whole wall holds the ends together."""
    unit = block((1, 1, 1), (1, 40, 1))
    radius, angle = RADIUS - WALL * (1 - unit.X[:, 0]), np.pi / 2 * unit.X[:, 1]
    X = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.4 * unit.X[:, 2]], axis=1)
    mesh = Mesh(*quadratic(X, unit.cells, boundary_facets(unit.cells)))
    flat = Mesh(*quadratic(unit.X, unit.cells, boundary_facets(unit.cells)))
    inner, outer = where(flat, 0, 0.0), where(flat, 0, 1.0)
    body = make_body(mesh, ELEMENTS["tet10"], Material(LAWS["neo-hookean"], SOFT, 0.0))
    body = with_layers(body, [(outer, fabric)])
    load = np.zeros_like(mesh.X)
    corners = mesh.X[inner[:, :3]]
    force = -pressure * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    np.add.at(load, inner[:, 3:], np.repeat(force[:, None] / 3, 3, axis=1))
    ends = (flat.X[:, 2] < 1e-9) | (flat.X[:, 2] > 1 - 1e-9)
    held = np.stack([flat.X[:, 1] > 1 - 1e-9, flat.X[:, 1] < 1e-9, ends], axis=1)
    x = newton(body, mesh.X, held, load, 1e-6)
    middles = outer[:, 3:]  # whose mean is that of a quadratic function over its triangle
    grown = float(
        np.mean(np.linalg.norm(x[middles][..., :2], axis=2) - np.linalg.norm(mesh.X[middles][..., :2], axis=2))
    )
    return grown, 4 * float(response(body, x).force[flat.X[:, 2] > 1 - 1e-9, 2].sum())


def test_a_membrane_is_inflated_as_a_thin_walled_tube():
    """u = p a r (1 - nu^2) / (E t), the pressure at the inner radius a; the wall's own E t, 5 % of the layer's, joins
    in. So fine a mesh, as flat faces under a stiff layer bulge between their edges."""
    young, thickness, pressure = 100.0, 0.1, 1e-4
    grown, _ = tube(Fabric(thickness, young, 0.3), pressure)
    inner = RADIUS - WALL
    hoop = young * thickness / (1 - 0.3**2) + SOFT * WALL
    assert grown == pytest.approx(pressure * inner * RADIUS / hoop, rel=0.02)


@pytest.mark.parametrize("degrees", [30.0, 50.0, 65.0])
def test_a_braided_tube_pulls_as_chou_and_hannaford_say(degrees):
    """Blocked force of a McKibben muscle whose fibres lie at an angle a from its axis (IEEE Trans. Robotics Autom. 12,
    1996): pi r^2 p (3 cos^2 a - 1) / sin^2 a, of which the pressure on the end takes pi r^2 p off what the wall pulls.
    The layer has radius r, and the pressure acts on the inner one, which weights p by a / r."""
    angle, pressure = np.radians(degrees), 1e-4
    families = tuple(Fibres(np.array([0.0, 0.0, 1.0]), side * angle, 1e4) for side in (1, -1))
    _, pull = tube(Fabric(0.1, fibres=families), pressure)
    area, at_layer = np.pi * RADIUS**2, pressure * (RADIUS - WALL) / RADIUS
    expected = area * at_layer * ((3 * np.cos(angle) ** 2 - 1) / np.sin(angle) ** 2 + 1)
    assert pull == pytest.approx(expected, rel=0.02)


def test_layers_follow_the_nodes_at_rest_and_leave_rigid_parts():
    body = layered("tet10")
    moved = on_nodes(body, replace(body.mesh, X=2 * body.mesh.X))
    assert response(moved, 2 * body.mesh.X).energy == 0.0
    assert sum(layer.weights.sum() for layer in moved.layers) == pytest.approx(4 * 0.2 * 4)
    within = np.where(body.mesh.X[:, 0] > 1 - 1e-9, 0, -1)
    left = without(body, within)
    assert [len(layer.facets) for layer in left.layers] == [2, 2]
    x = bent(body)
    x[within == 0] = body.mesh.X[within == 0]
    assert response(left, x).energy == pytest.approx(response(body, x).energy, rel=1e-12)


def test_wrong_layers_are_refused():
    body = box_body((2, 1, 1), (2, 1, 1), "tet10")
    upright = Fabric(0.1, fibres=(Fibres(np.array([0.0, 0.0, 1.0]), 0.0, 1.0),))
    with pytest.raises(InputError, match="normal to 4 faces"):
        with_layers(body, [(where(body.mesh, 2, 0.0), upright)])
    with pytest.raises(InputError, match="1 faces of a layer belong to no cell"):
        with_layers(body, [(np.array([[0, 5, 9, 1, 2, 3]]), FABRIC)])
