"""Natural frequencies: closed forms of bars and beams, of solids and rods; with cables held and free; damping."""

import numpy as np
import pytest
from fe_motion.moving import DENSITY, moving_bar, moving_rod
from support.rods import LENGTH, MATERIAL, SHAPE

from cfem.condensed.viscosity import Viscosity
from cfem.core.errors import InputError
from cfem.equilibrium.solve import rest_state, solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.fe_motion.modes import natural_modes

BENDING = np.array([1.875104068711961, 4.694091132974174, 7.854757438237613])  # of a clamped-free beam


def test_a_rod_bends_at_the_frequencies_of_a_beam_at_second_order():
    """Both directions alike; slender enough that shear and rotary inertia do 1e-3."""
    beam = BENDING**2 / (2 * np.pi * LENGTH**2) * np.sqrt(MATERIAL.young * SHAPE.bending / (DENSITY * SHAPE.area))
    errors = []
    for elements in (10, 20, 40):
        problem = moving_rod(elements)
        found = natural_modes(problem, rest_state(problem), 6, force([0.0]))
        np.testing.assert_allclose(found.frequency[::2], found.frequency[1::2], rtol=1e-6)
        errors.append(found.frequency[::2] / beam - 1)
    assert np.abs(errors[-1]).max() < 5e-3
    coarse, middle, fine = errors
    np.testing.assert_allclose((coarse - middle) / (middle - fine), 4.0, rtol=0.1)


def test_a_rod_stretches_and_twists_at_the_frequencies_of_a_bar():
    problem = moving_rod(40)
    found = natural_modes(problem, rest_state(problem), 40, force([0.0])).frequency
    stretch = np.sqrt(MATERIAL.young / DENSITY) / (4 * LENGTH)
    twist = np.sqrt(MATERIAL.young / 2 / DENSITY) / (4 * LENGTH)  # polar inertia 2 I, J = 2 I
    for wanted in (stretch, twist):
        assert np.abs(found / wanted - 1).min() < 1e-4


def test_a_solid_bar_stretches_at_that_of_a_bar():
    problem = moving_bar(element="tet10", law="st-venant-kirchhoff", poisson=0.0, divisions=(6, 1, 1), cables=1)
    found = natural_modes(problem, rest_state(problem), 12, force([0.0])).frequency
    wanted = np.sqrt(1.0 / DENSITY) / (4 * 60.0)
    assert np.abs(found / wanted - 1).min() < 1e-4


def test_held_cables_raise_the_frequencies():
    """Rayleigh: a constraint never lowers one, nor lifts it beyond the next."""
    problem = moving_bar(element="tet4", divisions=(6, 2, 2), cables=1)
    solved = solve(problem, displacement([4.0]))
    free = natural_modes(problem, solved.state, 5, force([0.0])).frequency
    held = natural_modes(problem, solved.state, 4).frequency
    assert (held >= free[:4] * (1 - 1e-9)).all()
    assert (held <= free[1:] * (1 + 1e-9)).all()
    assert held[0] > 1.02 * free[0] or held[1] > 1.02 * free[1]


def test_shapes_are_orthogonal_in_the_mass_and_of_unit_mass():
    problem = moving_bar(element="tet10p0", divisions=(4, 1, 1), cables=1, rigid_end=True)
    shapes = natural_modes(problem, rest_state(problem), 4).shapes
    M = np.einsum("nik,nil->kl", shapes, np.stack([problem.mass @ shapes[:, i] for i in range(3)], axis=1))
    np.testing.assert_allclose(M, np.eye(4), atol=1e-6)


def test_kelvin_voigt_damps_by_half_of_the_relaxation_time_times_omega():
    tau = 1e-3
    for problem in (
        moving_rod(10, [Viscosity(tau)]),
        moving_bar([Viscosity(tau)], element="tet10", poisson=0.0, divisions=(6, 1, 1), cables=1),
    ):
        found = natural_modes(problem, rest_state(problem), 3, force([0.0]))
        np.testing.assert_allclose(found.damping, tau * np.pi * found.frequency, rtol=1e-4)


def test_a_prony_series_stiffens_and_damps_by_its_complex_modulus():
    """Of a rod all of whose stiffness is viscous alike: omega^2 = omega_0^2 |1 + g i w tau / (1 + i w tau)|, its real
    part, at the frequency itself."""
    bare = natural_modes(moving_rod(10), rest_state(moving_rod(10)), 2, force([0.0])).frequency[0] * 2 * np.pi
    g, tau = 0.4, 0.01
    problem = moving_rod(10, [Viscosity(0.0, ((g, tau),))])
    found = natural_modes(problem, rest_state(problem), 2, force([0.0]))
    omega = found.frequency[0] * 2 * np.pi
    modulus = 1 + g * 1j * omega * tau / (1 + 1j * omega * tau)
    assert omega**2 == pytest.approx(bare**2 * modulus.real, rel=1e-6)
    assert found.damping[0] == pytest.approx(modulus.imag / (2 * modulus.real), rel=1e-6)


def test_a_prony_rod_is_near_the_pole_of_a_beam():
    """Roots of s^2 / w^2 + 1 + sum g s tau / (1 + s tau), w by a closed form: 4 % of the damping is of second order."""
    terms = ((0.3, 0.05), (0.08, 1.0))
    problem = moving_rod(20, [Viscosity(0.0, terms)])
    found = natural_modes(problem, rest_state(problem), 1, force([0.0]))
    omega = BENDING[0] ** 2 / LENGTH**2 * np.sqrt(MATERIAL.young * SHAPE.bending / (DENSITY * SHAPE.area))
    (g, tau), (h, sigma) = terms
    first, second = np.poly1d([tau, 1]), np.poly1d([sigma, 1])
    poles = np.poly1d([1 / omega**2, 0, 1]) * first * second
    poles = (poles + np.poly1d([g * tau, 0]) * second + np.poly1d([h * sigma, 0]) * first).roots
    pole = poles[np.argmax(poles.imag)]
    assert found.frequency[0] == pytest.approx(abs(pole) / (2 * np.pi), rel=0.01)
    assert found.damping[0] == pytest.approx(-pole.real / abs(pole), rel=0.05)


def test_a_robot_without_density_says_so():
    from support.blocks import bar

    from cfem.fe_motion.problem import MovingProblem

    with pytest.raises(InputError, match="no density"):
        MovingProblem(bar(element="tet4", divisions=(2, 1, 1)))
