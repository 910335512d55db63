"""Natural modes of the condensed dynamics, of systems whose modes are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from cfem.core.errors import NumericalError
from cfem.motion.modes import natural_modes


def of(K, M):
    """A model of one actuator whose other unknowns swing, without viscosity."""
    place = SimpleNamespace(M=np.array(M, float), K=np.array(K, float), F=[], effectors_by_q=np.ones((1, len(M))))
    return SimpleNamespace(at=lambda delta_a: place, n_a=1, losses=())


def test_frequencies_are_those_of_two_masses_between_springs():
    """Two equal masses with three equal springs: 1 and 3 of k / m (any textbook); with the first held, 2."""
    model = of([[2.0, -1.0], [-1.0, 2.0]], 1e-4 * np.eye(2))
    free = natural_modes(model, np.zeros(1), False, 2)
    np.testing.assert_allclose(free.frequency, np.sqrt(np.array([1.0, 3.0]) * 1e4) / (2 * np.pi), rtol=1e-12)
    np.testing.assert_allclose(np.abs(free.shapes[0] / free.shapes[1]), 1.0, rtol=1e-12)
    assert not free.damping.any()
    np.testing.assert_allclose(free.effectors, free.shapes.sum(axis=0)[None])
    held = natural_modes(model, np.zeros(1), True, 2)
    np.testing.assert_allclose(held.frequency, [np.sqrt(2e4) / (2 * np.pi)], rtol=1e-12)
    assert held.shapes.shape == (2, 1) and held.shapes[0, 0] == 0.0


@pytest.mark.parametrize(("K", "grow", "count"), [([1.0, -2.0, -3.0], 2, 3), ([-1.0, 2.0, 3.0], 1, 2)])
def test_a_robot_that_buckles_is_refused_with_the_number_of_modes_that_grow(K, grow, count):
    said = rf"{grow} of the {count} lowest modes grow: the robot is unstable at \[0.5\] mm"
    with pytest.raises(NumericalError, match=said):
        natural_modes(of(np.diag(K), np.eye(3)), np.array([0.5]), False, count)


def test_a_neutral_mode_counts_as_one_that_grows():
    with pytest.raises(NumericalError, match="1 of the 1 lowest"):
        natural_modes(of(np.diag([0.0, 1.0]), np.eye(2)), np.zeros(1), False, 1)
