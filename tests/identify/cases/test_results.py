"""Values that no material has."""

from types import SimpleNamespace

from cfem.identify.cases.results import implausible

DENSITY = [SimpleNamespace(name="density", keys=("material.density",))]


def told(low, high):
    return implausible(DENSITY, {"density": {"value": (low + high) / 2, "interval": [low, high], "unit": "t/mm^3"}})


def test_a_density_that_no_rubber_has_is_told():
    (sentence,) = told(1.55e-9, 1.85e-9)
    assert "density 1700 kg/m^3 is implausible (rubbers have 900 to 1400)" in sentence


def test_a_density_that_may_be_one_of_rubber_is_not():
    assert told(1.2e-9, 1.8e-9) == []


def test_a_modulus_is_not_judged():
    young = [SimpleNamespace(name="young", keys=("material.young",))]
    assert implausible(young, {"young": {"value": 1e5, "interval": [9e4, 2e5], "unit": "MPa"}}) == []


def test_a_drive_is_judged_where_something_is_known_of_it():
    estimate = {"drive": {"value": 3.0, "interval": [2.9, 3.1], "unit": "1"}}
    for known in (True, False):
        drive = SimpleNamespace(name="drive", keys=("drive.c.scale",), known=known)
        assert len(implausible([drive], estimate)) == known
