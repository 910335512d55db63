"""Constants of rubber models against the energies that define them."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from robot.scenes import scene
from support.laws import energy_density

from cfem.core.artefact.files import plain
from cfem.core.errors import SpecError
from cfem.core.spec import meaning
from cfem.mechanics.material import LAWS
from cfem.robot.build import as_material
from cfem.robot.elastomers import ELASTOMERS
from cfem.robot.materials import MaterialRegion, MaterialSpec, read_material

MOONEY = {"law": "mooney-rivlin", "c10": "0.3 MPa", "c01": "50 kPa", "poisson": 0.49}
OGDEN = {"law": "ogden", "mu": {"kPa": [630, 1.2, -10]}, "alpha": [1.3, 5.0, -2.0], "poisson": 0.49}
STRETCHES = np.array([[1.4, 1.4**-0.5, 1.4**-0.5], [0.7, 0.7**-0.5, 0.7**-0.5], [1.2, 1.5, 1 / 1.8]])  # of volume 1


def material(data):
    return TypeAdapter(MaterialSpec).validate_python(data)


def energy(data):
    """(3,) MPa at STRETCHES, as mechanics has it."""
    made = as_material(material(data))
    F = np.array([np.diag(row) for row in STRETCHES])
    return energy_density(made.law, F, made.young, made.poisson, made.shape)


def test_mooney_rivlin_is_that_of_its_constants():
    square = STRETCHES**2
    expected = 0.3 * (square.sum(axis=1) - 3) + 0.05 * ((1 / square).sum(axis=1) - 3)
    np.testing.assert_allclose(energy(MOONEY), expected, rtol=1e-9)


def test_ogden_is_that_of_its_constants():
    expected = sum(
        mu / alpha * ((STRETCHES**alpha).sum(axis=1) - 3) for mu, alpha in ((0.63, 1.3), (0.0012, 5.0), (-0.01, -2.0))
    )
    np.testing.assert_allclose(energy(OGDEN), expected, rtol=1e-9)


@pytest.mark.parametrize("law", ["neo-hookean", "neo-hookean-log", "corotational", "st-venant-kirchhoff"])
def test_a_material_by_its_youngs_modulus(law):
    made = as_material(material({"law": law, "young": "3000 kPa", "poisson": 0.3}))
    assert (made.law, made.young, made.poisson, made.shape) == (LAWS[law], 3.0, 0.3, None)


def test_every_law_of_mechanics_can_be_asked_for_and_neo_hookean_needs_no_name():
    schema = str(TypeAdapter(MaterialSpec).json_schema())
    assert all(f"'{law}'" in schema for law in LAWS)
    assert material({"young": "1 MPa", "poisson": 0.3}).law == "neo-hookean"


@pytest.mark.parametrize(
    "data, part",
    [
        (MOONEY | {"c01": "-0.3 MPa"}, r"shear modulus, 2 \(c10 \+ c01\), must be positive, got 0 MPa"),
        (OGDEN | {"alpha": [-1.3, 5.0, -2.0]}, "shear modulus, sum of mu_i alpha_i / 2, must be positive"),
        (OGDEN | {"alpha": [1.3, 5.0]}, "mu and alpha must have equally many numbers, got 3 and 2"),
        (OGDEN | {"alpha": [1.3, 0.0, -2.0]}, "not 0"),
        (MOONEY | {"poisson": 0.5}, "use at most 0.4999"),
        (MOONEY | {"poisson": -0.1}, "greater than or equal to 0"),
        (MOONEY | {"density": "0 kg/m^3"}, "greater than 0"),
        ({"young": "0 MPa", "poisson": 0.3}, "greater than 0"),
        ({"young": "1 MPa", "poisson": 0.3, "c10": "1 MPa"}, "Extra inputs"),
        ({"law": "hooke", "young": "1 MPa", "poisson": 0.3}, "hooke"),
    ],
)
def test_what_is_no_material_is_refused(data, part):
    with pytest.raises(ValidationError, match=part):
        material(data)


def test_a_flat_box_is_no_region():
    flat = {"kind": "box", "corners": {"mm": [[0, 0, 0], [1, 1, 0]]}}
    with pytest.raises(ValidationError, match="without volume"):
        MaterialRegion.model_validate({"region": flat, "material": {"young": "1 MPa", "poisson": 0.3}})


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
