"""What a spec of a device may say."""

import pytest
from pydantic import ValidationError
from support.spec_fields import demand_field

from cfem.plant.device.spec import DynamixelSpec, MotorSpec, ProgramSpec, SerialPortSpec, UdpSpec


def motor(**fields) -> MotorSpec:
    return MotorSpec.model_validate({"id": 1, "spool": "10 mm", **fields})


def test_a_spool_has_any_radius_above_none():
    assert motor(spool="0.4 mm").spool == 0.4
    for spool in ("0 mm", "-2 mm"):
        with pytest.raises(ValidationError, match="greater than 0"):
            motor(spool=spool)


def test_a_motor_has_a_number_of_the_bus():
    assert (motor(id=0).id, motor(id=252).id) == (0, 252)
    for number in (-1, 253):
        with pytest.raises(ValidationError, match="equal to"):
            motor(id=number)


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (ProgramSpec, "command", ["a"], [], []),
        (SerialPortSpec, "port", "a", "", []),
        (SerialPortSpec, "baud", 1, 0, [115200]),
        (UdpSpec, "host", "a", "", []),
        (UdpSpec, "port", 1, 0, []),
        (UdpSpec, "port", 65535, 65536, []),
        (DynamixelSpec, "port", "a", "", []),
        (DynamixelSpec, "baud", 1, 0, [57600]),
        (DynamixelSpec, "counts", 1, 0, [4096]),
        (DynamixelSpec, "motors", {"a": {"id": 1, "spool": "10 mm"}}, {}, []),
    ],
)
def test_what_a_device_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
