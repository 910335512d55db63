"""Overstress: closed forms of relaxation and creep of one element, rotations, consistent stiffness."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.blocks import box_body
from support.rods import rod_body

from cfem.condensed.viscosity import Viscosity
from cfem.mechanics.assembly import make_pattern, symmetric_product
from cfem.mechanics.body import response
from cfem.mechanics.viscosity import (
    add_solid_stiffness,
    overstress,
    remembered,
    settled,
    solid_force,
    stresses,
)

KELVIN, PRONY = Viscosity(0.02), Viscosity(0.0, ((0.4, 0.05), (0.2, 0.5)))


def sheared(body, amount):
    x = body.mesh.X.copy()
    x[:, 0] += amount * body.mesh.X[:, 1]
    return x


def stress_after(body, viscosity, histories, dt):
    """Q of the first region at the end of steps to positions x."""
    memory = settled(body, [viscosity], response(body, body.mesh.X))
    for x in histories:
        over = overstress(body, [viscosity], memory, dt)
        at = response(body, x)
        a, B = over.parts[0]
        Q = a * stresses(body, at)[0] + B
        memory = remembered(body, [viscosity], memory, dt, at)
    return Q, stresses(body, at)[0]


@pytest.mark.parametrize("element", ["tet4", "tet10p0", "hex8"])
def test_a_step_in_strain_relaxes_as_the_prony_series(element):
    body = box_body((1, 1, 1), (1, 1, 1), element)
    x, dt, n = sheared(body, 0.1), 0.01, 20
    Q, S = stress_after(body, PRONY, [x] * n, dt)
    # the step takes dt: its middle is the exact start to second order
    exact = sum(g * np.exp(-(n - 0.5) * dt / tau) for g, tau in PRONY.prony)
    np.testing.assert_allclose(Q, exact * S, rtol=2e-3, atol=1e-12)


def test_an_even_strain_rate_meets_kelvin_voigt_with_the_relaxation_time_times_the_rate():
    """Small strains, where S is linear in time."""
    body = box_body((1, 1, 1), (1, 1, 1), "tet4")
    n, dt = 10, 0.01
    Q, S = stress_after(body, KELVIN, [sheared(body, 1e-6 * i) for i in range(1, n + 1)], dt)
    np.testing.assert_allclose(Q, KELVIN.relaxation * S / (n * dt), rtol=1e-5, atol=2e-11)


@pytest.mark.parametrize("viscosity", [KELVIN, PRONY])
def test_a_rotation_is_not_resisted(viscosity):
    body = box_body((1, 1, 1), (1, 1, 1), "tet10p0")
    strained = sheared(body, 0.2)
    memory = settled(body, [viscosity], response(body, strained))
    for angle in (0.3, 0.9):
        x = strained @ Rotation.from_rotvec([0, angle, angle]).as_matrix().T
        over, at = overstress(body, [viscosity], memory, 0.01), response(body, x)
        force = solid_force(body, at, over)
        assert np.abs(force).max() < 1e-12
        memory = remembered(body, [viscosity], memory, 0.01, at)


@pytest.mark.parametrize("element", ["tet4", "tet10p0", "hex8"])
def test_its_stiffness_is_the_derivative_of_its_force(element):
    """Along motions; of hexahedra at rest alone, where the bubbles' change of slope adds nothing."""
    body = box_body((1, 1, 1), (1, 1, 1), element)
    rng = np.random.default_rng(1)
    X = body.mesh.X
    x = X if element == "hex8" else X + 0.03 * rng.normal(size=X.shape)
    motion = rng.normal(size=X.shape)
    viscosity = [Viscosity(0.02, ((0.4, 0.05),))]
    before = X if element == "hex8" else X + 0.03 * rng.normal(size=X.shape)
    over = overstress(body, viscosity, settled(body, viscosity, response(body, before)), 0.01)
    pattern = make_pattern(len(X), [body.cells], np.empty(0, dtype=int))
    data = np.zeros(pattern.nnz)
    add_solid_stiffness(body, response(body, x), over, pattern.slots[0], data)
    h = 1e-6
    ahead, behind = (solid_force(body, response(body, x + s * h * motion), over) for s in (1, -1))
    np.testing.assert_allclose(
        symmetric_product(pattern, data, motion.reshape(-1, 1))[:, 0],
        ((ahead - behind) / (2 * h)).ravel(),
        atol=2e-7 * np.abs(data).max(),
    )


def test_regions_without_viscosity_cost_nothing_and_rods_mix_materials():
    body = box_body((1, 1, 1), (1, 1, 1), "tet4")
    memory = settled(body, [Viscosity()], response(body, body.mesh.X))
    assert overstress(body, [Viscosity()], memory, 0.1).parts == (None,)
    rod = rod_body(4)
    rod = replace(rod, rod=replace(rod.rod, numbers=np.array([0, 0, 1, 1])))
    memory = settled(rod, [Viscosity(), KELVIN], response(rod, rod.mesh.X))
    a, _ = overstress(rod, [Viscosity(), KELVIN], memory, 0.1).parts[0]
    np.testing.assert_allclose(a[:, 0], [0, 0, 0.2, 0.2])


def test_its_modulus_is_the_fourier_transform_of_its_relaxation():
    """int_0^inf of g exp(-t / tau) i w exp(-i w t) dt, by quadrature."""
    omega = 7.0
    t = np.linspace(0, 20, 2_000_001)
    relaxation = sum(g * np.exp(-t / tau) for g, tau in PRONY.prony)
    transform = np.trapezoid(relaxation * 1j * omega * np.exp(-1j * omega * t), t)
    np.testing.assert_allclose(PRONY.modulus(omega), [transform.real, transform.imag], rtol=1e-6)
