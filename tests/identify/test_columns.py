"""Columns of actuators, whose commands have the unit of what they state."""

from cfem.identify.columns import actuator_columns


def test_a_chamber_has_a_volume_and_a_pressure_and_is_commanded_by_either():
    units = [("mm^3", "MPa")]
    assert actuator_columns(["air"], units) == {"air.displacement": "mm^3", "air.force": "MPa"}
    assert actuator_columns(["air"], units, "force")["air.command"] == "MPa"
    assert actuator_columns(["air"], units, "displacement")["air.command"] == "mm^3"
