"""What a spec of a run may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.control.task.run_spec import PlannedSpec, RunSpec, SearchSpec, TrackingSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (SearchSpec, "iterations", 1, 0, [20]),
        (SearchSpec, "regularisation", 0.0, -1e-12, [1e-10]),
        (SearchSpec, "preload", "1 mm", "x", [0.0]),
        (SearchSpec, "damping", 0.0, -1e-12, [0.0]),
        (SearchSpec, "weights", [0.0, 1.0], [-1e-9], [None]),
        (RunSpec, "models", {"a": "model"}, {}, []),
        (TrackingSpec, "trajectories", {"a": {"kind": "goals", "points": {"mm": [[0, 0, 0]]}}}, {}, []),
        (PlannedSpec, "reached", "1 um", "0 mm", [0.1]),
        (PlannedSpec, "reached_rotation", "1 urad", "0 deg", [0.0017453292519943296]),
        (PlannedSpec, "pictures", 1, 0, [60]),
    ],
)
def test_what_a_search_and_a_run_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
