"""The battery that every law must pass, and for each law closed forms that it was not derived from."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.laws import energy_density, tangent

from cfem.mechanics.material import LAWS, Material
from cfem.mechanics.material.law import evaluate, lame, stress

YOUNG = 2.0
every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())


def gradients(seed: int, size: float = 0.25, count: int = 6) -> np.ndarray:
    F = np.eye(3) + size * np.random.default_rng(seed).standard_normal((4 * count, 3, 3))
    return F[np.linalg.det(F) > 0.2][:count]


def differences(function, F, h=1e-6):
    """Central differences of function(F) by each entry of F, last axis 9."""
    columns = []
    for entry in range(9):
        step = np.zeros(9)
        step[entry] = h
        step = step.reshape(3, 3)
        columns.append((function(F + step) - function(F - step)) / (2 * h))
    return np.stack(columns, axis=-1)


def check_derivatives(law, F, poisson):
    P, C = stress(law, F, YOUNG, poisson), tangent(law, F, YOUNG, poisson)
    size = np.abs(C).max()
    expected_P = differences(lambda G: energy_density(law, G, YOUNG, poisson), F).reshape(-1, 3, 3)
    np.testing.assert_allclose(P, expected_P, atol=1e-8 * size)
    expected_C = differences(lambda G: stress(law, G, YOUNG, poisson), F).reshape(-1, 9, 9)
    np.testing.assert_allclose(C, expected_C, atol=1e-7 * size)
    np.testing.assert_allclose(C, np.swapaxes(C, 1, 2), atol=1e-14 * size)


@every_law
@given(seed=st.integers(0, 2**31), poisson=st.floats(0.0, 0.499))
@settings(max_examples=20, deadline=None)
def test_stress_and_tangent_are_derivatives_of_the_energy(law, seed, poisson):
    check_derivatives(law, gradients(seed), poisson)


@every_law
@pytest.mark.parametrize("gap", [0.0, 1e-15, 1e-12, 1e-8, 1e-5, 1e-3])
@pytest.mark.parametrize("stretches", [(1.0, 1.0, 1.0), (1.3, 1.3, 0.6), (0.7, 1.6, 0.7), (1.2, 1.2, 1.2)])
def test_derivatives_hold_where_stretches_nearly_coincide(law, stretches, gap):
    left, right = (rotation.as_matrix() for rotation in Rotation.random(2, random_state=1))
    stretched = np.diag(np.array(stretches) + gap * np.array([1.0, -1.0, 0.3]))
    check_derivatives(law, np.stack([stretched, left @ stretched @ right]), 0.4)


@every_law
def test_linearises_to_hooke(law):
    lam, mu = lame(YOUNG, 0.4)
    identity = np.eye(9).reshape(3, 3, 3, 3)
    hooke = lam * np.einsum("ij,kl->ijkl", np.eye(3), np.eye(3)) + mu * (identity + identity.transpose(0, 1, 3, 2))
    np.testing.assert_allclose(
        tangent(law, np.eye(3)[None], YOUNG, 0.4)[0], hooke.reshape(9, 9), atol=1e-14 * YOUNG * 10
    )


@every_law
@given(seed=st.integers(0, 2**31))
@settings(max_examples=20, deadline=None)
def test_rotation_leaves_the_energy_and_turns_the_stress(law, seed):
    F = gradients(seed)
    Q = Rotation.random(random_state=seed).as_matrix()
    energy, P = energy_density(law, F, YOUNG, 0.45), stress(law, F, YOUNG, 0.45)
    for turned, turned_P in ((Q @ F, Q @ P), (F @ Q, P @ Q)):  # of the body, and of the material in it (isotropy)
        np.testing.assert_allclose(energy_density(law, turned, YOUNG, 0.45), energy, rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(stress(law, turned, YOUNG, 0.45), turned_P, rtol=1e-12, atol=1e-11)


@every_law
def test_small_strain_keeps_its_digits(law):
    strain = 1e-9 * np.array([[1.0, 0.3, 0.0], [0.3, -0.5, 0.2], [0.0, 0.2, 0.7]])
    parameters, _ = Material(law, young=2.6, poisson=0.3).moduli  # mu = 1
    psi, theta, P, _ = evaluate(law, strain[None], parameters)
    np.testing.assert_allclose(P[0] / 2, strain, rtol=0, atol=1e-16)
    assert theta[0] == pytest.approx(np.trace(strain), abs=2e-16)
    assert psi[0] == pytest.approx(np.sum(strain**2), rel=1e-9)


@every_law
def test_scales_with_young_and_has_lambda_for_bulk(law):
    _, bulk = Material(law, YOUNG, 0.4).moduli
    assert bulk == pytest.approx(lame(YOUNG, 0.4)[0], rel=1e-15)
    F = gradients(3)
    np.testing.assert_allclose(stress(law, F, 5 * YOUNG, 0.4), 5 * stress(law, F, YOUNG, 0.4), rtol=1e-13, atol=1e-13)
    with pytest.raises(ValueError, match="shape number"):
        _ = Material(law, YOUNG, 0.4, shape=(0.1, 0.2, 0.3)).moduli


@every_law
@pytest.mark.parametrize("J", [0.0, -0.5, np.nan])
def test_inverted_point_raises_nothing_and_leaves_its_neighbour_alone(law, J):
    F = np.stack([np.diag([1.0, 1.0, J]), np.diag([1.1, 0.9, 1.2])])
    alone = F[1:]
    for function in (energy_density, stress, tangent):
        both = function(law, F, YOUNG, 0.4)
        np.testing.assert_array_equal(both[1:], function(law, alone, YOUNG, 0.4))
        if law.name in ("neo-hookean-log", "mooney-rivlin", "ogden", "yeoh"):
            assert np.isnan(both[0]).all()
        elif np.isfinite(J):
            assert np.isfinite(both[0]).all()


@every_law
def test_extreme_stretches_are_finite(law):
    F = np.stack([np.diag([100.0, 0.1, 0.1]), np.diag([1e-3, 1.0, 1.0]), np.diag([1e-3, 1e-3, 1e6]), 20 * np.eye(3)])
    for function in (energy_density, stress, tangent):
        assert np.isfinite(function(law, F, YOUNG, 0.49)).all()


def test_neo_hookean_uniaxial_stretch_against_closed_form():
    # psi at F = diag(a, b, b): P11 = mu a - mu b^2 + (lam + mu) (a b^2 - 1) b^2, lateral stress likewise
    lam, mu = lame(YOUNG, 0.3)
    a, b = 1.4, 0.9
    P = stress(LAWS["neo-hookean"], np.diag([a, b, b])[None], YOUNG, 0.3)[0]
    J = a * b * b
    assert P[0, 0] == pytest.approx(mu * a - mu * b * b + (lam + mu) * (J - 1) * b * b, rel=1e-13)
    assert P[1, 1] == pytest.approx(mu * b - mu * a * b + (lam + mu) * (J - 1) * a * b, rel=1e-12)


def test_corotational_is_linear_in_a_pure_stretch():
    lam, mu = lame(YOUNG, 0.3)
    stretch = np.diag([0.1, -0.05, 0.2])
    P = stress(LAWS["corotational"], (np.eye(3) + stretch)[None], YOUNG, 0.3)[0]
    np.testing.assert_allclose(P, 2 * mu * stretch + lam * np.trace(stretch) * np.eye(3), atol=1e-14)


@pytest.mark.parametrize("a", [0.4, 0.9, 1.7])
def test_st_venant_kirchhoff_bar_is_cubic(a):
    # free sides: E_lateral = -nu E_axial, P = young/2 (a^3 - a)
    poisson = 0.3
    b = np.sqrt(1 - poisson * (a * a - 1))
    P = stress(LAWS["st-venant-kirchhoff"], np.diag([a, b, b])[None], YOUNG, poisson)[0]
    np.testing.assert_allclose(P, np.diag([YOUNG / 2 * (a**3 - a), 0, 0]), atol=1e-14)


@pytest.mark.parametrize("a", [0.05, 0.8, 3.0])
def test_logarithmic_neo_hookean_cauchy_stress(a):
    # Bonet and Wood, section 6.4: sigma = mu/J (b - 1) + lambda/J ln J, here of a dilatation; and without lambda a bar
    # keeps its thickness
    law, (lam, mu) = LAWS["neo-hookean-log"], lame(YOUNG, 0.3)
    sigma = stress(law, a * np.eye(3)[None], YOUNG, 0.3)[0] / a**2
    np.testing.assert_allclose(sigma, (mu * (a * a - 1) + 3 * lam * np.log(a)) / a**3 * np.eye(3), rtol=1e-10)
    P = stress(law, np.diag([a, 1.0, 1.0])[None], YOUNG, 0.0)[0]
    np.testing.assert_allclose(P, np.diag([YOUNG / 2 * (a - 1 / a), 0, 0]), rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("share", [0.0, 0.2, 1.0])
def test_mooney_rivlin_simple_shear(share):
    # Rivlin's normal stresses: sigma_11 - sigma_33 = 2 c10 gamma^2, sigma_22 - sigma_33 = -2 c01 gamma^2
    gamma, (_, mu) = 0.8, lame(YOUNG, 0.45)
    F = np.eye(3) + gamma * np.outer([1, 0, 0], [0, 1, 0])
    sigma = stress(LAWS["mooney-rivlin"], F[None], YOUNG, 0.45, (share,))[0] @ F.T
    assert sigma[0, 1] == pytest.approx(mu * gamma, rel=1e-13)
    assert sigma[0, 0] - sigma[2, 2] == pytest.approx(mu * (1 - share) * gamma**2, rel=1e-13)
    assert sigma[1, 1] - sigma[2, 2] == pytest.approx(-mu * share * gamma**2, rel=1e-13)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_ogden_with_powers_2_and_minus_2_is_mooney_rivlin(share):
    F, ogden = gradients(5), (1 - share, 2.0, share, -2.0)
    for function in (energy_density, stress, tangent):
        expected = function(LAWS["mooney-rivlin"], F, YOUNG, 0.45, (share,))
        np.testing.assert_allclose(
            function(LAWS["ogden"], F, YOUNG, 0.45, ogden), expected, rtol=1e-12, atol=1e-13 * np.abs(expected).max()
        )


@pytest.mark.parametrize("shape", [(0.0, 0.0), (-0.03, 0.002), (0.2, 0.0)])
def test_yeoh_simple_shear(shape):
    # I1bar - 3 = gamma^2: shear stress 2 psi' gamma, first normal stress difference 2 psi' gamma^2, the second none
    gamma, c1 = 1.3, lame(YOUNG, 0.45)[1] / 2
    F = np.eye(3) + gamma * np.outer([1, 0, 0], [0, 1, 0])
    sigma = stress(LAWS["yeoh"], F[None], YOUNG, 0.45, shape)[0] @ F.T
    slope = 2 * c1 * (1 + 2 * shape[0] * gamma**2 + 3 * shape[1] * gamma**4)
    assert sigma[0, 1] == pytest.approx(slope * gamma, rel=1e-13)
    assert sigma[0, 0] - sigma[1, 1] == pytest.approx(slope * gamma**2, rel=1e-13)
    assert sigma[1, 1] == pytest.approx(sigma[2, 2], abs=1e-14)


def test_yeoh_with_its_first_constant_alone_is_mooney_rivlin_with_its_first_alone():
    F = gradients(5)
    for function in (energy_density, stress, tangent):
        expected = function(LAWS["mooney-rivlin"], F, YOUNG, 0.45, (0.0,))
        np.testing.assert_allclose(
            function(LAWS["yeoh"], F, YOUNG, 0.45, (0.0, 0.0)),
            expected,
            rtol=1e-12,
            atol=1e-13 * np.abs(expected).max(),
        )


@pytest.mark.parametrize("a", [0.5, 1.7, 4.0])
def test_yeoh_tension_against_his_formula(a):
    c1, c2, c3 = 0.11, 0.02, -0.0003  # MPa
    e = a**2 + 2 / a - 3
    expected = 2 * (a - a**-2) * (c1 + 2 * c2 * e + 3 * c3 * e**2)  # Yeoh 1993
    found = incompressible_tension(LAWS["yeoh"], np.array([a]), 2 * c1 * 2 * 1.499, (c2 / c1, c3 / c1))
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def incompressible_tension(law, a, young, shape=None):
    """(k,) MPa: axial nominal stress at stretches a (k,), the sides free and J = 1."""
    F = np.zeros((len(a), 3, 3))
    F[:, 0, 0], F[:, 1, 1], F[:, 2, 2] = a, a**-0.5, a**-0.5
    P = stress(law, F, young, 0.499, shape)
    return P[:, 0, 0] - P[:, 1, 1] * a**-1.5


def test_ogden_tension_against_his_formula_and_treloars_rubber():
    a = np.array([1.39, 2.18, 3.02, 4.03, 5.36, 6.4, 7.05])
    measured = np.array([3.23, 6.00, 8.80, 12.5, 19.9, 31.0, 42.1])  # kg/cm^2; Treloar, Trans. Faraday Soc. 40, 1944
    mu, alpha = np.array([6.3, 0.012, -0.1]), np.array([1.3, 5.0, -2.0])  # kg/cm^2; Ogden 1972
    formula = (mu * (a[:, None] ** (alpha - 1) - a[:, None] ** (-alpha / 2 - 1))).sum(axis=1)
    P = incompressible_tension(LAWS["ogden"], a, young=4.225 * 2 * 1.499)  # mu = sum mu_p alpha_p / 2
    np.testing.assert_allclose(P, formula, rtol=1e-12)
    np.testing.assert_allclose(P, measured, rtol=0.12)
