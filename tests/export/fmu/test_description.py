"""modelDescription.xml for any names and units that a robot may have."""

import pytest
from export.embedded import spectral
from fmpy.validation import validate_fmu

from cfem.export.fmu.description import UNITS, Fmu, model_description
from cfem.export.fmu.variables import controller_blocks, robot_blocks
from cfem.export.spec import CSpec
from cfem.predict.load import build

NAMES = ["cable-1", "2nd", "a..b", "left.upper", "_x"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("command", ["displacement", "force"])
def test_any_name_and_unit_is_valid(tmp_path, name, command):
    meta, arrays = spectral()
    rows = {"effectors": [f"{name}.x", f"{name}.y", f"{name}.rx"], "actuators": [name, "other"]}
    units = [["mm", "N"], ["mm", "N"], ["rad", "N mm"], ["mm", "N"], ["mm^3", "MPa"]]
    model = build({**meta, "rows": rows, "row_units": units}, arrays)
    spec = CSpec(controller={"command": command, "observer": "measured"})
    for blocks in (controller_blocks(model, spec), robot_blocks(model, spec, [1.0, 2.0])):
        fmu = Fmu("it", "<&>", blocks, 0.01, None, False)
        (tmp_path / "modelDescription.xml").write_bytes(model_description(fmu, "{1}"))
        assert validate_fmu(str(tmp_path)) == []
    commanded = {one.name: one.unit for one in blocks["COMMAND"]}
    expected = ("mm", "mm^3") if command == "displacement" else ("N", "MPa")
    assert tuple(commanded.values()) == expected and "command.other" in commanded


def test_factors_are_those_of_pint():
    import pint

    registry = pint.UnitRegistry()
    for name, (exponents, factor) in UNITS.items():
        base = {{"m": "meter", "kg": "kilogram", "s": "second", "rad": "radian"}[k]: v for k, v in exponents.items()}
        quantity = registry.Quantity(1.0, name.replace("N mm", "N*mm")).to_base_units()
        assert quantity.magnitude == pytest.approx(factor) and dict(quantity._units) == base
