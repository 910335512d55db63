"""Values of a design as the user writes them, and a learned model at them."""

import numpy as np
import pytest

from cfem.condensed.parameters import Parameter
from cfem.control.design import Bound, parameter_values
from cfem.core.errors import SpecError

PARAMETERS = (
    Parameter("E", "material.young", "MPa", 1.0, 10.0, 3.0, "log", True),
    Parameter("L", "geometry.segment_length", "mm", 38.0, 42.0, 40.0),
    Parameter("nu", "material.poisson", "1", 0.4, 0.49, 0.47, "log(1-2p)"),
)


def test_what_is_left_out_is_the_scenes_own():
    np.testing.assert_allclose(parameter_values(PARAMETERS, {"L": "4.1 cm", "nu": 0.45}), [3.0, 41.0, 0.45])
    np.testing.assert_allclose(parameter_values(PARAMETERS, {"E": "5000 kPa"}), [5.0, 40.0, 0.47])


@pytest.mark.parametrize(
    ("design", "says"),
    [
        ({"H": "20 mm"}, "design.H: no parameter of the models"),
        ({"L": "45 mm"}, "design.L: 45 mm is not between 38 and 42"),
        ({"L": "45 kPa"}, "design.L"),
        ({"nu": "soft"}, "design.nu"),
    ],
)
def test_what_is_no_design_is_said_with_its_name(design, says):
    with pytest.raises(SpecError, match=says):
        parameter_values(PARAMETERS, design)


class Recorder:
    """Says what it was asked."""

    rows = "rows"

    def __getattr__(self, name):
        return lambda *asked: (name, *asked)


def test_a_bound_model_asks_at_its_own_parameters():
    p = np.array([1.0, 2.0])
    bound = Bound(Recorder(), p)
    for name in ("at_displacement", "inside", "distance"):
        assert getattr(bound, name)("state") == (name, "state", p)
    assert bound.rows == "rows"
