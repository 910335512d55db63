"""The battery that every law must pass."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import energy_density, lame, stress, tangent

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


@every_law
@given(seed=st.integers(0, 2**31), poisson=st.floats(0.0, 0.499))
@settings(max_examples=20, deadline=None)
def test_stress_and_tangent_are_derivatives_of_the_energy(law, seed, poisson):
    F = gradients(seed)
    P, C = stress(law, F, YOUNG, poisson), tangent(law, F, YOUNG, poisson)
    size = np.abs(C).max()
    expected_P = differences(lambda G: energy_density(law, G, YOUNG, poisson), F).reshape(-1, 3, 3)
    np.testing.assert_allclose(P, expected_P, atol=1e-8 * size)
    expected_C = differences(lambda G: stress(law, G, YOUNG, poisson), F).reshape(-1, 9, 9)
    np.testing.assert_allclose(C, expected_C, atol=1e-7 * size)
    np.testing.assert_allclose(C, np.swapaxes(C, 1, 2), atol=1e-14 * size)


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
    before, after = (energy_density(law, G, YOUNG, 0.45) for G in (F, Q @ F))
    np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(stress(law, Q @ F, YOUNG, 0.45), Q @ stress(law, F, YOUNG, 0.45), atol=1e-11)


@every_law
def test_small_strain_keeps_its_digits(law):
    strain = 1e-9 * np.array([[1.0, 0.3, 0.0], [0.3, -0.5, 0.2], [0.0, 0.2, 0.7]])
    out = np.empty(1), np.empty(1), np.empty((1, 3, 3)), np.empty((1, 3, 3))
    law.response(strain[None], 1.0, *out)
    np.testing.assert_allclose(out[2][0] / 2, strain, rtol=0, atol=1e-16)
    assert out[1][0] == pytest.approx(np.trace(strain), abs=2e-16)


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
