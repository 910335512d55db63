"""Values of parameters as the user writes them."""

import numpy as np
import pytest

from cfem.condensed.parameter_values import vector
from cfem.condensed.parameters import Parameter
from cfem.core.errors import SpecError

PARAMETERS = (
    Parameter("E", "material.young", "MPa", 1.0, 10.0, 3.0, "log", True),
    Parameter("L", "geometry.segment_length", "mm", 38.0, 42.0, 40.0),
    Parameter("nu", "material.poisson", "1", 0.4, 0.49, 0.47, "log(1-2p)"),
)


def test_what_is_left_out_is_the_scenes_own():
    np.testing.assert_allclose(vector(PARAMETERS, {"L": "4.1 cm", "nu": 0.45}, "design"), [3.0, 41.0, 0.45])
    np.testing.assert_allclose(vector(PARAMETERS, {"E": "5000 kPa"}, "design"), [5.0, 40.0, 0.47])


@pytest.mark.parametrize(
    ("design", "says"),
    [
        ({"H": "20 mm"}, "design: unknown parameter 'H'"),
        ({"L": "45 mm"}, r"design.L: 45 is out of the range \[38, 42\] mm"),
        ({"L": "45 kPa"}, "design.L"),
        ({"nu": "soft"}, "design.nu"),
    ],
)
def test_what_is_no_design_is_said_with_its_name(design, says):
    with pytest.raises(SpecError, match=says):
        vector(PARAMETERS, design, "design")
