"""The ticks at which a planned command changes."""

import numpy as np
import pytest
from pydantic import ValidationError

from cfem.motion.mpc_spec import MpcSpec, blocks


@pytest.mark.parametrize(
    ("ticks", "moves", "expected"),
    [(8, 4, [0, 1, 2, 4]), (8, 1, [0]), (3, 3, [0, 1, 2]), (3, 9, [0, 1, 2]), (16, 5, [0, 1, 2, 4, 8])],
)
def test_known_plans(ticks, moves, expected):
    assert blocks(ticks, moves).tolist() == expected


@pytest.mark.parametrize("ticks", [2, 5, 20, 61])
@pytest.mark.parametrize("moves", [1, 2, 3, 7, 20])
def test_every_plan_begins_at_once_and_holds_later_commands_longer(ticks, moves):
    begins = blocks(ticks, moves)
    assert len(begins) == min(ticks, moves) and begins[0] == 0 and begins[-1] < ticks
    lengths = np.diff([*begins, ticks])
    assert (lengths >= 1).all() and lengths[-1] >= lengths[0] and np.diff(lengths).min(initial=0) >= -1


@pytest.mark.parametrize(
    ("field", "allowed", "refused"),
    [("horizon", 2, 1), ("moves", 1, 0), ("smooth", 1e-9, 0.0), ("effort", 0.0, -1e-12)],
)
def test_what_a_horizon_may_be(field, allowed, refused):
    assert getattr(MpcSpec(**{field: allowed}), field) == allowed
    with pytest.raises(ValidationError, match=field):
        MpcSpec(**{field: refused})


def test_what_a_predictive_controller_takes_where_nothing_is_stated():
    """The figures of docs/control-in-motion.md are of these."""
    spec = MpcSpec()
    assert (spec.horizon, spec.moves, spec.smooth, spec.effort) == (20, None, 1e-2, 1e-10)
    doubt = spec.doubt
    assert (doubt.noise, doubt.stiffness, doubt.viscosity, doubt.wander) == (None, 0.2, 0.3, 0.1)
    assert (doubt.offset, doubt.push) == (0.3, 0.03)
