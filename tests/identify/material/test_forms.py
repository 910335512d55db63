"""Incompressible laws in principal stretches against the laws that finite elements solve."""

import numpy as np
import pytest

from cfem.identify.material.forms import (
    FORMS,
    MODES,
    curvature,
    kirchhoff,
    log_stretches,
    nominal_stress,
    shear_modulus,
)
from cfem.identify.material.stability import is_stable_to, least_stiffness, stable_to
from cfem.mechanics.material.law import stress
from cfem.robot.build import as_material
from cfem.robot.materials import read_material

# name of the form, moduli, exponents, and the same law as a scene writes it
SAME = {
    "neo-hookean": ([0.2], [], {"law": "yeoh", "c1": "0.2 MPa"}),
    "mooney-rivlin": ([0.6, -0.1], [], {"law": "mooney-rivlin", "c10": "0.3 MPa", "c01": "0.05 MPa"}),
    "yeoh-2": ([0.11, 0.02], [], {"law": "yeoh", "c1": "0.11 MPa", "c2": "0.02 MPa"}),
    "yeoh-3": ([0.2, -0.01, 0.001], [], {"law": "yeoh", "c1": "0.2 MPa", "c2": "-10 kPa", "c3": "1 kPa"}),
    "ogden-2": ([0.6, -0.05], [1.3, -2.5], {"law": "ogden", "mu": {"MPa": [0.6, -0.05]}, "alpha": [1.3, -2.5]}),
}
same = pytest.mark.parametrize("name", SAME)
STRETCH = np.array([0.6, 0.95, 1.3, 2.2])


def elements_stress(data, h):
    """(m, 3, 3) MPa first Piola-Kirchhoff stress at log stretches h (m, 3), as the solver has it."""
    made = as_material(read_material({**data, "poisson": 0.45}))
    F = np.array([np.diag(row) for row in np.exp(h)])
    return stress(made.law, F, made.young, made.poisson, made.shape)


@same
@pytest.mark.parametrize("mode", MODES)
def test_nominal_stress_is_that_of_the_law_that_elements_have(name, mode):
    moduli, alpha, data = SAME[name]
    h = log_stretches(mode, STRETCH)
    np.testing.assert_allclose(h.sum(axis=1), 0, atol=1e-15)
    P = elements_stress(data, h)
    free = P[:, 2, 2] * np.exp(h[:, 2] - h[:, 0])  # what a pressure takes off so that axis 3 is free
    found = nominal_stress(FORMS[name], alpha, mode, STRETCH) @ moduli
    np.testing.assert_allclose(found, P[:, 0, 0] - free, rtol=1e-11)


@same
def test_curvature_is_the_derivative_of_the_stress(name):
    form, (_, alpha, _) = FORMS[name], SAME[name]
    h, step = np.random.default_rng(0).normal(0, 0.4, (6, 3)), 1e-6
    expected = np.stack(
        [
            (kirchhoff(form, alpha, h + step * one) - kirchhoff(form, alpha, h - step * one)) / (2 * step)
            for one in np.eye(3)
        ],
        axis=2,
    )
    found = curvature(form, alpha, h)
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(found).max())


@same
def test_shear_modulus_is_a_third_of_the_slope_of_tension_at_rest(name):
    form, (moduli, alpha, _) = FORMS[name], SAME[name]
    up, down = (nominal_stress(form, alpha, "uniaxial", np.array([1 + e])) @ moduli for e in (1e-5, -1e-5))
    assert (up - down)[0] / 2e-5 == pytest.approx(3 * shear_modulus(form, alpha) @ moduli, rel=1e-8)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("moduli", [[0.2, -0.01, 0.0002], [0.2, -0.02, 0.0], [0.1, 0.01, 0.0]])
def test_least_stiffness_has_the_sign_of_the_least_work_of_increments(mode, moduli):
    """Work d t : d h of increments in all directions, t of the law that elements have, by differences."""
    c1, c2, c3 = moduli
    data = {"law": "yeoh", "c1": f"{c1} MPa", "c2": f"{c2} MPa", "c3": f"{c3} MPa"}
    angle = np.linspace(0, np.pi, 181)
    ways = np.stack([np.cos(angle), np.sin(angle), -np.cos(angle) - np.sin(angle)], axis=1)
    for stretch in (1.2, 1.9, 2.6, 3.3):
        h, step = log_stretches(mode, np.array([stretch])), 1e-5
        t = [
            np.diagonal(elements_stress(data, h + sign * step * ways), axis1=1, axis2=2)
            * np.exp(h + sign * step * ways)
            for sign in (1, -1)
        ]
        least = ((t[0] - t[1]) * ways).sum(axis=1).min() / (2 * step)
        assert np.sign(least) == np.sign(least_stiffness(FORMS["yeoh-3"], [], np.array(moduli), h)[0])


def test_a_positive_neo_hookean_law_is_stable_everywhere_and_a_softening_one_to_its_force_maximum_at_most():
    everywhere = stable_to(FORMS["neo-hookean"], [], np.array([0.2]), 5.0)
    assert everywhere == pytest.approx({"uniaxial": 5, "biaxial": 5, "planar": 5, "compression": 0.2})
    soft = stable_to(FORMS["yeoh-2"], [], np.array([0.2, -0.02]), 5.0)
    # psi' = 0.2 - 0.04 (I1 - 3) vanishes at I1 = 8, where shear has no resistance at all: lambda^2 + 2 / lambda = 8
    assert 1.2 < soft["uniaxial"] < np.roots([1, 0, -8, 2]).max()


def test_a_law_that_is_unstable_at_once_in_every_mode_is_stable_in_none():
    limits = stable_to(FORMS["neo-hookean"], [], np.array([-0.1]), 3.0)
    assert set(limits.values()) == {1.0} and not is_stable_to(limits, 3.0)
    assert is_stable_to(stable_to(FORMS["neo-hookean"], [], np.array([0.1]), 3.0), 3.0)
