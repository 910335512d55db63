"""Constants of rubber models against the energies that define them."""

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from support.laws import energy_density

from cfem.mechanics.material import LAWS
from cfem.robot.build import as_material
from cfem.robot.materials import MaterialRegion, MaterialSpec

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
