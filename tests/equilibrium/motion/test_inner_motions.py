"""Inner motions of a rod: against the full model's frequencies, dense algebra and the constancy of their stiffness."""

import numpy as np
import pytest
from fe_motion.moving import moving_rod
from scipy.linalg import eigh

from cfem.condensed.viscosity import Viscosity
from cfem.equilibrium.motion.inertia import mass_of
from cfem.equilibrium.motion.inner_motions import rod_stresses
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.fe_motion.modes import natural_modes

TAU = 2e-3


@pytest.fixture(scope="module")
def known():
    """The problem, its mass, the stresses and solves at two pressures."""
    moving = moving_rod(8, [Viscosity(TAU)], ((0.3, 0.5), (-0.5, 0.1)))
    problem, mass = Problem(moving.robot), mass_of(moving.robot)
    stresses = rod_stresses(problem, mass)
    found = [
        solve(problem, force(lam), wanted=Wanted(mass=mass, stresses=stresses)) for lam in ([0.0, 0.0], [0.04, 0.02])
    ]
    assert all(one.converged for one in found)
    return moving, stresses, found


def test_frequencies_are_those_of_the_full_model_from_above(known):
    moving, _, found = known
    for solved in found:
        inner, W = solved.inertia.inner, solved.condensed.W_aa
        K = np.zeros_like(inner.M)
        K[:2, :2], K[2:, 2:] = np.linalg.inv(W), inner.K
        for first, held in ((0, force(np.zeros(2))), (2, None)):
            ours = np.sqrt(eigh(K[first:, first:], inner.M[first:, first:])[0][:3]) / (2 * np.pi)
            full = natural_modes(moving, solved.state, 3, held).frequency
            assert (ours >= full * (1 - 1e-6)).all()
            np.testing.assert_allclose(ours, full, rtol=5e-3)


def test_their_stiffness_is_the_same_at_all_states_and_is_what_viscosity_damps(known):
    still, pulled = (one.inertia.inner for one in known[2])
    np.testing.assert_allclose(pulled.K, still.K, atol=1e-6 * np.abs(still.K).max())
    np.testing.assert_allclose(pulled.loss[0][2:, 2:], pulled.K, atol=1e-6 * np.abs(still.K).max())
    np.testing.assert_allclose(np.diag(still.K), 1.0, rtol=1e-6)  # stresses of energy 1 N mm


def test_they_leave_the_actuators_alone_and_cost_no_factorisation(known):
    moving, stresses, (_, solved) = known
    bare = solve(Problem(moving.robot), force([0.04, 0.02]))
    assert solved.factorizations == bare.factorizations
    inner, M = solved.inertia.inner, mass_of(moving.robot)
    assert solved.inertia.V2 is None and inner.e.shape == (3, stresses.shape[2])
    # the mass of the actuators' motions is that of V
    W, V = solved.condensed.W_aa, solved.inertia.V[3:, 3:]
    wanted = np.linalg.solve(W, np.linalg.solve(W, V).T)
    np.testing.assert_allclose(inner.M[:2, :2], wanted, rtol=1e-6)
    assert M.shape[0] == len(moving.robot.X)
