"""What every other benchmark is divided by when releases are compared: machines differ, ratios hold."""

import numpy as np
import pytest


@pytest.mark.benchmark(group="reference")
def test_reference(benchmark):
    matrix = np.random.default_rng(0).standard_normal((300, 300)) + 300 * np.eye(300)
    assert np.isfinite(benchmark(np.linalg.solve, matrix, np.ones(300))).all()
