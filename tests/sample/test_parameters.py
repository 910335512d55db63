"""A key of the scene becomes a parameter with the scene's unit and range, or one clear error."""

import numpy as np
import pytest
from pydantic import ValidationError
from robot.scenes import scene

from cfem.condensed.parameters import Parameter, from_shares
from cfem.core.errors import SpecError
from cfem.sample.parameters import scene_parameters, with_values
from cfem.sample.spec import ParameterSpec, SampleSpec

WEIGHT = {"gravity": "{acceleration: {m/s^2: [0, 0, -9.81]}}"}
HEAVY = WEIGHT | {"material": "{young: 1 MPa, poisson: 0.3, density: 1070 kg/m^3}"}


def parameter(folder, key, range_, **changes) -> Parameter:
    scene(folder, **changes)
    return scene_parameters({"it": ParameterSpec(key=key, range=range_)}, folder / "scene.yaml")[0]


def test_units_reference_and_coordinate_are_those_of_the_scene(tmp_path):
    nu = parameter(tmp_path, "material.poisson", [0.40, 0.49])
    assert nu == Parameter("it", "material.poisson", "1", 0.40, 0.49, 0.3, "log(1-2p)")
    young = parameter(tmp_path, "material.young", {"kPa": [1000, 10000]}, **HEAVY)
    assert young == Parameter("it", "material.young", "MPa", 1.0, 10.0, 1.0, "log")
    assert young == parameter(tmp_path, "material.young", ["1000 kPa", "10 MPa"], **HEAVY)
    radius = parameter(tmp_path, "actuators.0.radius", {"mm": [1, 3]})
    assert radius == Parameter("it", "actuators.0.radius", "mm", 1.0, 3.0, 2.0, "linear")
    density = parameter(tmp_path, "material.density", {"kg/m^3": [1000, 2000]}, **HEAVY)
    assert density.unit == "t/mm^3" and density.low == pytest.approx(1e-9)


REGION = {
    "materials": "[{region: {kind: sphere, centre: {mm: [25, 0, 0]}, radius: 4 mm}, "
    "material: {young: 9 MPa, poisson: 0.4}}]"
}
LOAD = {"loads": "[{point: {mm: [29, 0, 0]}, force: {N: [0, 0, 1]}}]"}
BELOW = "{kind: plane, point: {mm: [0, 0, -5]}, normal: [0, 0, -1]}"
PAPER = {
    "layers": f"[{{faces: {BELOW}, thickness: 0.1 mm, young: 6.5 GPa}}]",
    "mesh": "{size: 5 mm, element: tet10p0}",
}
LACKING = {"discrepancy": "{largest: {c: 2 N}, terms: [{forces: [c], effectors: {tip: {mm: [0.1, 0, 0]}}}]}"}


@pytest.mark.parametrize(
    ("more", "exact"),
    [({}, True), (HEAVY, False), (REGION, False), (LOAD, False), (PAPER, False), (LACKING, False)],
)
def test_young_modulus_is_exact_where_nothing_but_one_material_resists_the_actuators(tmp_path, more, exact):
    assert parameter(tmp_path, "material.young", ["1 MPa", "2 MPa"], **more).exact is exact


def test_the_stiffness_of_a_material_by_name_is_as_exact_as_a_modulus(tmp_path):
    found = parameter(tmp_path, "material.stiffness", [0.8, 1.3], material="{name: ecoflex-00-30}")
    assert found == Parameter("it", "material.stiffness", "1", 0.8, 1.3, 1.0, "log", exact=True)


@pytest.mark.parametrize(
    ("key", "range_", "message"),
    [
        ("mesh.size", ["5 mm", "6 mm"], "changes the mesh"),
        ("actuators.0.reach.1", ["5 mm", "6 mm"], "changes no state of the robot"),
        ("materials.0.region.radius", ["3 mm", "4 mm"], "changes the mesh"),
        ("material.poison", [0.3, 0.4], "no number at 'material.poison'"),
        ("material.law", [0.3, 0.4], "no number"),
        ("actuators.1.radius", ["1 mm", "2 mm"], "no number"),
        ("actuators.0.unilateral", [0, 1], "no number"),
        ("material.poisson", [0.4, 0.5], "material.poisson: an incompressible material"),
        ("material.young", [1, 2], "material.young: .* the bare number"),
        ("material.young", ["2 MPa", "1 MPa"], "the smaller first"),
    ],
)
def test_what_is_no_parameter_is_said_with_its_name(tmp_path, key, range_, message):
    with pytest.raises(SpecError, match=f"parameters.it.*{message}"):
        parameter(tmp_path, key, range_, **REGION)


def test_the_modulus_of_a_layer_is_a_parameter_and_its_place_is_none(tmp_path):
    found = parameter(tmp_path, "layers.0.young", ["1 GPa", "10 GPa"], **PAPER)
    assert found == Parameter("it", "layers.0.young", "MPa", 1e3, 1e4, 6.5e3, "log")
    thick = parameter(tmp_path, "layers.0.thickness", ["0.1 mm", "0.2 mm"], **PAPER)
    assert (thick.unit, thick.reference) == ("mm", 0.1)
    with pytest.raises(SpecError, match="changes the mesh"):
        parameter(tmp_path, "layers.0.faces.point.2", ["-5 mm", "-4 mm"], **PAPER)
    both = {
        "paper": ParameterSpec(key="layers.0.young", range=["1 GPa", "10 GPa"]),
        "wide": ParameterSpec(key="geometry.width", range=["9 mm", "11 mm"]),
    }
    with pytest.raises(SpecError, match=r"parameters\.paper: a layer cannot vary beside the geometry"):
        scene_parameters(both, tmp_path / "scene.yaml")


@pytest.mark.parametrize("range_", [[0.4], 0.4, {"kPa": [1]}, {"kPa": [1, 2], "mm": [1, 2]}, [1, 2, 3]])
def test_a_range_is_two_values(range_):
    with pytest.raises(ValidationError, match="expected two values"):
        ParameterSpec(key="material.poisson", range=range_)


def test_two_parameters_may_not_share_a_key():
    one = {"key": "material.poisson", "range": [0.3, 0.4]}
    splits = {"train": {"rows": 5, "method": "random"}}
    with pytest.raises(ValidationError, match="same key"):
        SampleSpec(scene="s", mesh="m", out="o", splits=splits, parameters={"a": one, "b": one})


def test_values_are_drawn_evenly_in_their_coordinate():
    nu = Parameter("nu", "material.poisson", "1", 0.4, 0.49, 0.3, "log(1-2p)")
    radius = Parameter("r", "actuators.0.radius", "mm", 1.0, 3.0, 2.0)
    np.testing.assert_allclose(from_shares([nu, radius], np.zeros(2)), [0.4, 1.0])
    np.testing.assert_allclose(from_shares([nu, radius], np.ones(2)), [0.49, 3.0])
    middle = from_shares([nu, radius], np.array([0.5, 0.5]))
    assert (1 - 2 * middle[0]) ** 2 == pytest.approx(0.2 * 0.02) and middle[1] == pytest.approx(2.0)
    assert from_shares([], np.zeros(0)).shape == (0,)


def test_values_are_put_where_their_keys_say_and_nowhere_else(tmp_path):
    before = scene(tmp_path, **REGION)
    after = with_values(before, ["materials.0.material.poisson", "actuators.0.radius"], np.array([0.2, 1.5]))
    assert after.materials[0].material.poisson == 0.2 and after.actuators[0].radius == 1.5
    assert (before.materials[0].material.poisson, before.actuators[0].radius) == (0.4, 2.0)
    assert after.material == before.material and after.materials[0].region is before.materials[0].region
