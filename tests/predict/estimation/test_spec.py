"""What a spec of an estimator may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.predict.estimation.spec import ActuatorSensorsSpec, DynamicsSpec, LoadsSpec, MarkersSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (LoadsSpec, "rows", ["tip.x"], [], []),
        (LoadsSpec, "largest", "1 uN", "0 N", []),
        (LoadsSpec, "lasts", "1 us", "0 s", [None]),
        (DynamicsSpec, "push", "1 um", "0 mm", [0.03]),
        (DynamicsSpec, "swing", "1 um", "0 mm", [None]),
        (DynamicsSpec, "stiffness", 0.0, -1e-9, [0.1]),
        (DynamicsSpec, "wander", 0.0, -1e-9, [0.1]),
        (ActuatorSensorsSpec, "displacement", "1 um", "0 mm", [None]),
        (ActuatorSensorsSpec, "force", "1 uN", "0 N", [None]),
        (ActuatorSensorsSpec, "slip", "1 um", "0 mm", [None]),
        (ActuatorSensorsSpec, "offset", "1 um", "0 mm", [None]),
        (MarkersSpec, "markers", {"a": {"mm": [0, 0, 0]}}, {}, []),
        (MarkersSpec, "noise", "1 um", "0 mm", []),
    ],
)
def test_what_an_estimator_may_know(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
