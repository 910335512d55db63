"""Shares of the variance against functions whose shares are known."""

import numpy as np
import pytest

from cfem.core.errors import NumericalError
from cfem.design.optimisers.sensitivity import line, shares


def ishigami(z: np.ndarray) -> np.ndarray:
    x = np.pi * (2 * z - 1)
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_shares_of_ishigamis_function_are_the_published_ones():
    """Saltelli et al., Global Sensitivity Analysis, 2008, table 4.3: a = 7, b = 0.1."""
    found = shares(lambda z: np.column_stack([ishigami(z), z[:, 1]]), 3, 4096)
    np.testing.assert_allclose(found["first"][0], [0.3139, 0.4424, 0], atol=0.01)
    np.testing.assert_allclose(found["total"][0], [0.5576, 0.4424, 0.2437], atol=0.01)
    np.testing.assert_allclose(found["total"][1], [0, 1, 0], atol=0.01)


def test_a_sum_of_two_objectives_is_told_for_each():
    found = shares(lambda z: np.column_stack([3 * z[:, 0] + 4 * z[:, 1]]), 2, 1024)
    np.testing.assert_allclose(found["first"][0], [9 / 25, 16 / 25], atol=5e-3)


def test_what_is_not_finite_is_refused():
    with np.errstate(invalid="ignore"), pytest.raises(NumericalError, match="not finite"):
        shares(lambda z: np.log(z[:, :1] - 0.5), 2, 64)


def test_the_parameters_that_matter_are_named_first():
    said = line("reach", ["L", "H", "wall"], np.array([0.2, 0.795, 0.004]))
    assert said == "reach depends on H 80 %, L 20 %, wall 0 %; 1 of 3 parameters matter below 1 %"
