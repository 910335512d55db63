"""A skin small enough to reckon with."""

import numpy as np

from cfem.condensed.skin import Skin


def square() -> Skin:
    """Four nodes of a square in the plane z = 0: one mode shifts it along x, one bends it along z."""
    rest = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    weights = np.array([0.3, 0.2, 0.3, 0.2])
    modes = np.zeros((2, 4, 3))
    modes[0, :, 0] = 1.0
    modes[1, :, 2] = [1.0, -1.0, 1.0, -1.0]
    return Skin(np.array([2, 3, 5, 7]), rest, np.array([[0, 1, 2], [0, 2, 3]]), weights, modes, np.zeros((3, 2)))
