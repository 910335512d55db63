import numpy as np
import pytest
from motion.learned import model

from cfem.motion.altered import Altered
from cfem.motion.modes import natural_modes
from cfem.motion.step import at_rest


def test_stiffness_raises_frequencies_by_its_root():
    """Viscosity goes with the modulus: a damping ratio is in proportion to the frequency."""
    plain = natural_modes(model(), [1.5], False, 2)
    stiff = natural_modes(Altered(model(), 1.21), [1.5], False, 2)
    np.testing.assert_allclose(stiff.frequency, 1.1 * plain.frequency, rtol=1e-6)
    np.testing.assert_allclose(stiff.damping, 1.1 * plain.damping, rtol=1e-6)
    assert at_rest(Altered(model(), 1.21), [1.5]).lam == pytest.approx(1.21 * at_rest(model(), [1.5]).lam)


def test_viscosity_damps_and_does_not_stiffen():
    plain = natural_modes(model(), [1.5], True, 1)
    thick = natural_modes(Altered(model(), viscosity=1.2), [1.5], True, 1)
    np.testing.assert_allclose(thick.frequency, plain.frequency, rtol=1e-9)
    np.testing.assert_allclose(thick.damping, 1.2 * plain.damping, rtol=1e-9)
