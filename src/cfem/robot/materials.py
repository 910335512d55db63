"""Spec of materials: Young's modulus, the constants of a rubber model, or a name."""

import difflib
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, GetJsonSchemaHandler, TypeAdapter

from cfem.core.spec import Spec, described
from cfem.core.units import Density, Stress, StressVector, Time
from cfem.robot.selection import Box, Selection


class ByName(Spec):
    """An elastomer by name. `cfem material show NAME` prints its constants, their range and their source."""

    name: str
    """Name of the elastomer, as `cfem material list` has it."""
    stiffness: float = Field(default=1.0, gt=0)
    """Factor on all moduli: what a calibration finds where the batch is stiffer or softer than the constants."""
    poisson: float = Field(default=0.499, ge=0, lt=0.5)
    """Poisson's ratio, from 0 to 0.4999."""
    density: Density | None = Field(default=None, gt=0)
    """Density, the maker's unless given."""


def constants_of(data: dict[str, Any]) -> dict[str, Any]:
    """Constants of a material that a scene gives by name. ValueError where no elastomer has that name, or where a key
    beside it does not go with a name."""
    from cfem.robot.elastomers import ELASTOMERS, POISSON

    name = data["name"]
    if not isinstance(name, str) or name not in ELASTOMERS:
        near = difflib.get_close_matches(str(name), ELASTOMERS, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else "`cfem material list` shows all"
        raise ValueError(f"no elastomer is called '{name}' ({hint})")
    strange = [key for key in data if key not in ByName.model_fields]
    if strange:
        allowed = ", ".join(key for key in ByName.model_fields if key != "name")
        raise ValueError(f"'{strange[0]}' does not go with a name, which takes {allowed}")
    elastomer = ELASTOMERS[name]
    given = {key: value for key, value in data.items() if key != "name" and value is not None}
    return {"poisson": POISSON, "density": elastomer.density, **elastomer.constants, **given}


class NameAllowed:
    """Marks an annotation whose JSON Schema takes a name as well."""

    def __get_pydantic_json_schema__(self, core: Any, handler: GetJsonSchemaHandler) -> dict:
        from cfem.robot.elastomers import ELASTOMERS

        named = handler(ByName.__pydantic_core_schema__)
        for key, text in described(ByName).items():
            named["properties"][key]["description"] = text
        named["properties"]["name"]["enum"] = list(ELASTOMERS)
        return {"anyOf": [handler(core), named]}


def _compressible(value: float) -> float:
    if not value < 0.5:
        raise ValueError("an incompressible material has no finite bulk modulus: use at most 0.4999")
    return value


Poisson = Annotated[float, Field(ge=0), AfterValidator(_compressible)]
MaybeDensity = Annotated[Density, Field(gt=0)] | None
Factor = Annotated[float, Field(gt=0)]


class PronyTerm(Spec):
    """One term of a Prony series: a share of stress that fades."""

    share: float = Field(gt=0)
    """What the term adds at once, as a share of the modulus after a long time."""
    time: Time = Field(gt=0)
    """Time in which it fades to 1/e."""


class ViscositySpec(Spec):
    """How a material resists the rate of its strain, not counting pure changes of volume. Moduli beside it are those
    after a long time. It matters to motion only, not to equilibria."""

    relaxation: Time = Field(default=0.0, ge=0)
    """Kelvin-Voigt: the viscous stress is this time the rate of the elastic stress. The damping ratio of a vibration at
    f Hz is pi f times it."""
    prony: list[PronyTerm] = []
    """Terms of a Prony series, for a material that relaxes."""


class _Material(Spec):
    """What every material states."""

    poisson: Poisson
    """Poisson's ratio, from 0 to 0.4999."""
    density: MaybeDensity = None
    """Density. Needed under gravity and for motion only."""
    viscosity: ViscositySpec | None = None
    """Viscosity, none unless given."""


class Elastic(_Material):
    """A hyperelastic material by its Young's modulus."""

    law: Literal["neo-hookean", "neo-hookean-log", "corotational", "st-venant-kirchhoff"] = "neo-hookean"
    """The energy of the material."""
    young: Stress = Field(gt=0)
    """Young's modulus."""

    @property
    def shape(self) -> None:
        """None: the law has no constants beside Young's modulus and Poisson's ratio."""
        return None


class _Rubber(_Material):
    """A law by its own constants."""

    stiffness: Factor = 1.0
    """Factor on all moduli: what a calibration finds where the batch is stiffer or softer than the constants."""

    @property
    def young(self) -> float:
        """Young's modulus MPa of the constants times `stiffness`."""
        return 2 * self.stiffness * self.shear * (1 + self.poisson)


class MooneyRivlin(_Rubber):
    """Mooney-Rivlin rubber: c10 (I1 - 3) + c01 (I2 - 3) of isochoric invariants, and a volumetric part. The shear
    modulus is 2 (c10 + c01)."""

    law: Literal["mooney-rivlin"]
    """Mooney-Rivlin rubber."""
    c10: Stress
    """Constant of the first invariant."""
    c01: Stress
    """Constant of the second invariant."""

    def check(self) -> None:
        _demand_stiffness("2 (c10 + c01)", self.shear)

    @property
    def shear(self) -> float:
        """Shear modulus MPa of the constants alone."""
        return 2 * (self.c10 + self.c01)

    @property
    def shape(self) -> tuple[float, ...]:
        """Share of c01 in c10 + c01."""
        return (self.c01 / (self.c10 + self.c01),)


class Yeoh(_Rubber):
    """Yeoh rubber: c1 (I1 - 3) + c2 (I1 - 3)^2 + c3 (I1 - 3)^3 of the first isochoric invariant, and a volumetric part.
    The shear modulus is 2 c1."""

    law: Literal["yeoh"]
    """Yeoh rubber."""
    c1: Stress = Field(gt=0)
    """Constant of the first power."""
    c2: Stress = 0.0
    """Constant of the second power."""
    c3: Stress = 0.0
    """Constant of the third power."""

    @property
    def shear(self) -> float:
        """Shear modulus MPa of the constants alone."""
        return 2 * self.c1

    @property
    def shape(self) -> tuple[float, ...]:
        """Ratios (c2/c1, c3/c1) of the constants."""
        return self.c2 / self.c1, self.c3 / self.c1


class Ogden(_Rubber):
    """Ogden rubber: the sum of mu_i / alpha_i (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) of isochoric principal
    stretches l, and a volumetric part. The shear modulus is the sum of mu_i alpha_i / 2."""

    law: Literal["ogden"]
    """Ogden rubber."""
    mu: StressVector
    """Modulus of each term."""
    alpha: list[float] = Field(min_length=1)
    """Exponent of each term, as many as mu."""

    def check(self) -> None:
        if len(self.alpha) != len(self.mu):
            raise ValueError(f"mu and alpha must have equally many numbers, got {len(self.mu)} and {len(self.alpha)}")
        if not np.isfinite(self.alpha).all() or 0.0 in self.alpha:
            raise ValueError("alpha must be finite and not 0")
        _demand_stiffness("sum of mu_i alpha_i / 2", self.shear)

    @property
    def shear(self) -> float:
        """Shear modulus MPa of the constants alone."""
        return float(self.mu @ np.asarray(self.alpha)) / 2

    @property
    def shape(self) -> tuple[float, ...]:
        """Weights and exponents (w_1, alpha_1, w_2, alpha_2, ...): w_i the share of term i in the shear modulus."""
        share = self.mu * np.asarray(self.alpha) / (2 * self.shear)
        return tuple(float(number) for pair in zip(share, self.alpha, strict=True) for number in pair)


def _demand_stiffness(formula: str, shear: float) -> None:
    if not shear > 0:
        raise ValueError(f"the shear modulus, {formula}, must be positive, got {shear:g} MPa")


def _by_constants(data: Any) -> Any:
    if not isinstance(data, dict):
        return data
    return constants_of(data) if "name" in data else {"law": "neo-hookean", **data}


MaterialSpec = Annotated[
    Annotated[Elastic | MooneyRivlin | Ogden | Yeoh, Field(discriminator="law")],
    BeforeValidator(_by_constants),
    NameAllowed(),
]


def read_material(data: dict[str, Any]) -> Elastic | MooneyRivlin | Ogden | Yeoh:
    """Material from the mapping under `material:` in a scene. ValueError where it is no material."""
    return TypeAdapter(MaterialSpec).validate_python(data)


class MaterialRegion(Spec):
    """Another material for a part of the body. Meshes that cfem makes conform to a box, so that no cell straddles its
    faces. Exceptions are meshes of an .stl, and hexahedra where the box is askew to the bar."""

    region: Selection
    """The cells whose centroid lies in this region, or a named cell set."""
    material: MaterialSpec
    """Material of these cells."""

    def check(self) -> None:
        if isinstance(self.region, Box) and not (self.region.high > self.region.low).all():
            raise ValueError("a box without volume selects no material")
