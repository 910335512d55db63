"""A learned model at the parameters of one design."""

import numpy as np

from cfem.control.design import Bound


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
