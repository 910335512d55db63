"""What a controller over time is where its spec says nothing."""

import pytest
from support.spec_fields import demand_field

from cfem.control.closed_loop.spec import (
    ControllerSpec,
    DriftSpec,
    GainsSpec,
    LoopSpec,
    RealSpec,
    SensorSpec,
    SettleSpec,
)


def test_a_tick_takes_one_inverse_step_as_in_the_paper_from_the_equilibrium_of_its_command():
    spec = ControllerSpec(mode="closed")
    assert (spec.iterations, spec.observer, spec.gains) == (1, "equilibrium", None)


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (GainsSpec, "proportional", 0.0, -1e-9, [0.0]),
        (GainsSpec, "integral", 0.0, -1e-9, [None]),
        (ControllerSpec, "iterations", 1, 0, [1]),
        (SettleSpec, "radius", "1 um", "0 mm", []),
        (SettleSpec, "hold", "0 s", "-1 ms", []),
        (SettleSpec, "at_most", "1 ms", "0 s", [10.0]),
        (SensorSpec, "noise", "0 mm", "-1 um", [0.0]),
        (SensorSpec, "rate", "1 Hz", "0 Hz", [None]),
        (GainsSpec, "bound", "1 um", "0 mm", [None]),
        (SensorSpec, "delay", 0, -1, [0]),
        (DriftSpec, "stiffness", 1e-9, 0.0, []),
        (DriftSpec, "within", "1 us", "0 s", []),
        (RealSpec, "stiffer", 1e-9, 0.0, [1.0]),
        (RealSpec, "viscosity", 0.0, -1e-9, [1.0]),
        (LoopSpec, "controllers", {"a": {"mode": "open"}}, {}, []),
        (LoopSpec, "rate", "1 Hz", "0 Hz", []),
        (LoopSpec, "goal_every", "1 ms", "0 s", [None]),
        (LoopSpec, "approach", "0 s", "-1 ms", [1.0]),
        (LoopSpec, "budget", "1 ms", "0 s", [None]),
        (LoopSpec, "seeds", [0], [], [[0]]),
        (LoopSpec, "answer_within", "1 ms", "0 s", [1.0]),
    ],
)
def test_what_a_loop_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)


def test_a_goal_that_waits_may_be_held_for_as_long_as_it_is_tried():
    loop = {"rate": "50 Hz", "command": {"kind": "force"}, "controllers": {"a": {"mode": "open"}}}
    for hold, more in (("2 s", {}), ("3 s", {"goal_every": "1 s"})):
        LoopSpec.model_validate(loop | more | {"settle": {"radius": "1 mm", "hold": hold, "at_most": "2 s"}})
    with pytest.raises(ValueError, match=r"settle\.hold: a goal is given up after settle\.at_most"):
        LoopSpec.model_validate(loop | {"settle": {"radius": "1 mm", "hold": "3 s", "at_most": "2 s"}})
