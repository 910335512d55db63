"""The contractions of d2C/dw2 against the full tensor, and their derivatives against differences."""

import numpy as np
import pytest
from support.serial_rows import DELTA, chain

from cfem.condensed.packing import unpacking
from cfem.predict.loads.curvature import CurvatureSeries
from cfem.predict.series.chebyshev import basis

W = np.array([0.5, -0.4, 0.3, 2.0, 1.0, -3.0, 0.2, 0.1, -0.6])


@pytest.mark.parametrize("watched", [9, 6])
def test_contractions_are_those_of_the_tensor(watched):
    (model,), at = chain(mixed=False, curved=True).models, DELTA[:2]
    w, held = W[:watched], CurvatureSeries(model, watched).at(at)
    values = model.arrays["fourth"] @ basis(model.box(at)[None], model.arrays["fourth_indices"])[0]
    E = values[unpacking(9, 4)][:watched, :watched, :watched, :watched]
    assert held.square(w) == pytest.approx(np.einsum("ijkl,k,l->ij", E, w, w) / 2, rel=1e-12)
    assert held.cubic(w)[0] == pytest.approx(np.einsum("ijkl,j,k,l->i", E, w, w, w) / 6, rel=1e-12)


def test_derivatives_by_the_actuators_against_differences():
    (model,), at, h = chain(mixed=False, curved=True).models, DELTA[:2], 1e-4
    series = CurvatureSeries(model, 9)
    here = series.at(at).cubic(W)
    for n, step in enumerate(h * np.eye(2)):
        ahead, behind = (series.at(at + side * step).cubic(W) for side in (1, -1))
        size = np.abs(here).max()
        assert (ahead[0] - behind[0]) / (2 * h) == pytest.approx(here[1 + n], abs=1e-6 * size)
        for m in range(2):
            assert (ahead[1 + m] - behind[1 + m])[:] / (2 * h) == pytest.approx(here[3 + 2 * m + n], abs=1e-6 * size)
