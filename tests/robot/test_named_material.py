"""Materials by name."""

import pytest
from pydantic import TypeAdapter
from robot.scenes import scene

from cfem.core.artefact.files import plain
from cfem.core.errors import SpecError
from cfem.core.spec import meaning
from cfem.robot.elastomers import ELASTOMERS
from cfem.robot.materials import MaterialSpec, read_material


def test_a_name_stands_for_constants(tmp_path):
    named = scene(tmp_path, material="{name: ecoflex-00-30}")
    constants = ELASTOMERS["ecoflex-00-30"].constants
    written = scene(
        tmp_path,
        material=f"{{law: yeoh, c1: {constants['c1']}, c2: {constants['c2']}, poisson: 0.499, density: 1070 kg/m^3}}",
    )
    assert plain(meaning(named)) == plain(meaning(written))  # a hash that follows the constants, not the name


def test_the_maker_states_the_density_that_gravity_needs(tmp_path):
    gravity = "{acceleration: {m/s^2: [0, 0, -9.81]}}"
    made = scene(tmp_path, material="{name: dragon-skin-30}", gravity=gravity)
    assert made.material.density == pytest.approx(1.08e-9)
    heavier = scene(tmp_path, material="{name: dragon-skin-30, density: 1200 kg/m^3}", gravity=gravity)
    assert heavier.material.density == pytest.approx(1.2e-9)


def test_stiffness_scales_all_moduli():
    soft, stiff = read_material({"name": "dragon-skin-10"}), read_material({"name": "dragon-skin-10", "stiffness": 1.3})
    assert stiff.young == pytest.approx(1.3 * soft.young) and stiff.shape == soft.shape


@pytest.mark.parametrize(
    "material, part",
    [
        (
            "{name: ecoflex-0030}",
            r"scene.yaml:\d+: material: no elastomer is called 'ecoflex-0030' \(did you mean 'ecoflex-00-30'",
        ),
        ("{name: honey}", "`cfem material list` shows all"),
        ("{name: [ecoflex-00-30]}", "no elastomer is called"),
        (
            "{name: ecoflex-00-30, young: 70 kPa}",
            "'young' does not go with a name, which takes stiffness, poisson, density",
        ),
        ("{name: ecoflex-00-30, stiffness: 0}", "material.stiffness: must be greater than 0"),
        ("{name: ecoflex-00-30, poisson: 0.5}", "use at most 0.4999"),
    ],
)
def test_bad_names_are_one_sentence(tmp_path, material, part):
    with pytest.raises(SpecError, match=part):
        scene(tmp_path, material=material)


def test_editors_know_the_names():
    import jsonschema

    schema = TypeAdapter(MaterialSpec).json_schema()
    for good in (
        {"name": "ecoflex-00-30"},
        {"name": "sylgard-184", "stiffness": 2.25},
        {"young": "1 MPa", "poisson": 0.3},
    ):
        jsonschema.validate(good, schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"name": "honey"}, schema)
