"""Free oscillations: windows of known decay, a recording that an integrator made of another form of the same law, and
the poles of a polynomial."""

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

from cfem.condensed.viscosity import Viscosity
from cfem.core.errors import InputError
from cfem.identify.oscillation.law import fit_viscosity, free_vibration
from cfem.identify.oscillation.ring_down import ring_down

TERMS, ELASTIC, SAG, RELEASE = ((0.3, 0.008), (0.07, 0.4)), 7.0, -6.5, 0.30
TIME = np.arange(0, 4.3, 0.01)


def recording():
    """mm, of strains alpha that follow u in each term: Q = g (u - alpha), alpha' = (u - alpha) / tau. Someone holds the
    body with the force of its weight, and lets it go within 30 ms."""
    omega = 2 * np.pi * ELASTIC

    def rate(t, state):
        u, v, alpha = state[0], state[1], state[2:]
        overstress = sum(g * (u - a) for (g, _), a in zip(TERMS, alpha, strict=True))
        load = SAG * np.clip((t - RELEASE) / 0.03, 0, 1)
        follow = [(u - a) / tau for (_, tau), a in zip(TERMS, alpha, strict=True)]
        return [v, omega**2 * (load - u - overstress), *follow]

    span = (0, TIME[-1])
    return solve_ivp(rate, span, np.zeros(4), t_eval=TIME, rtol=1e-9, atol=1e-9, max_step=0.005).y[0]


def test_a_window_finds_amplitude_frequency_and_damping_beside_another_vibration():
    t = np.arange(0, 1.5, 0.01)
    phase = 2 * np.pi * 7.8 * (t - 0.3)
    decay = np.exp(-0.05 * phase) * np.cos(np.sqrt(1 - 0.05**2) * phase + 0.4)
    stand = 0.1 * np.exp(-2 * np.pi * 9.9 * 0.02 * t) * np.sin(2 * np.pi * 9.9 * t)
    found = ring_down(t, 2.0 * decay + stand + 0.3 - 0.1 * t, 0.3, 0.9, 7.0, others=[(9.9, 0.02)])
    assert found.amplitude == pytest.approx(2.0, rel=1e-3)
    assert (found.frequency, found.damping) == pytest.approx((7.8, 0.05), rel=1e-3)


def test_the_law_of_a_recording_comes_back_whatever_its_release_was_like():
    times = [tau for _, tau in TERMS]
    found = fit_viscosity(TIME, recording(), 0.5, times, guess=7.8)
    np.testing.assert_allclose([g for g, _ in found.viscosity.prony], [g for g, _ in TERMS], rtol=0.01)
    assert found.elastic == pytest.approx(ELASTIC, rel=1e-3)
    assert found.residual < 1e-3


def test_terms_that_a_recording_does_not_have_are_left_out():
    found = fit_viscosity(TIME, recording(), 0.5, [0.008, 0.05, 0.4, 4.0], guess=7.8)
    shares = dict((tau, g) for g, tau in found.viscosity.prony)
    assert shares[0.008] == pytest.approx(0.3, rel=0.03) and shares[0.4] == pytest.approx(0.07, rel=0.03)
    assert all(shares.get(tau, 0.0) < 0.003 for tau in (0.05, 4.0))


def test_the_modulus_that_the_shape_at_last_has_told_is_kept():
    """After four seconds the terms bear nothing: it is the modulus after a long time."""
    found = fit_viscosity(TIME, recording(), 0.5, [0.008, 0.05, 0.4, 4.0], guess=7.8, still=ELASTIC)
    assert found.elastic == pytest.approx(ELASTIC, rel=1e-4)
    assert dict((tau, g) for g, tau in found.viscosity.prony)[0.008] == pytest.approx(0.3, rel=0.01)
    slow = fit_viscosity(TIME, recording(), 0.5, [0.008, 0.4, 100.0], guess=7.8, still=1.02 * ELASTIC)
    held = dict((tau, g) for g, tau in slow.viscosity.prony)[100.0]
    assert slow.elastic == pytest.approx(1.02 * ELASTIC / np.sqrt(1 + 0.97 * held), rel=0.005)


def test_the_scene_takes_what_it_prints():
    from pydantic import TypeAdapter

    from cfem.robot.materials import ViscositySpec

    found = fit_viscosity(TIME, recording(), 0.5, [tau for _, tau in TERMS], guess=7.8)
    terms = TypeAdapter(ViscositySpec).validate_python(yaml.safe_load(found.scene)["viscosity"]).prony
    np.testing.assert_allclose([(term.share, term.time) for term in terms], found.viscosity.prony, rtol=1e-3)


def test_a_pole_is_a_root_of_the_characteristic_polynomial():
    """(s^2 / omega^2 + 1 + tau s) (1 + s tau_1) + g s tau_1 = 0."""
    omega, g, tau, kelvin = 2 * np.pi * 5, 0.5, 0.04, 2e-3
    bare = np.poly1d([1 / omega**2, kelvin, 1])
    roots = (bare * np.poly1d([tau, 1]) + np.poly1d([g * tau, 0])).roots
    root = roots[np.argmax(roots.imag)]
    found = free_vibration(5.0, Viscosity(kelvin, ((g, tau),)))
    assert found == pytest.approx((abs(root) / (2 * np.pi), -root.real / abs(root)), rel=1e-9)


def test_bad_windows_say_what_to_do():
    with pytest.raises(InputError, match="samples"):
        ring_down(TIME, TIME, 1.0, 1.05, 7.0)
    with pytest.raises(InputError, match="before the release"):
        fit_viscosity(TIME, TIME, 0.0, [0.1], 7.0)
