"""What the robot is made of, as the user writes it: Young's modulus, or the constants of a rubber model."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from cfem.core.spec import Spec
from cfem.core.units import Density, Stress, StressVector
from cfem.robot.selection import Box, Selection


def _compressible(value: float) -> float:
    if not value < 0.5:
        raise ValueError("an incompressible material has no finite bulk modulus: use at most 0.4999")
    return value


Poisson = Annotated[float, Field(ge=0), AfterValidator(_compressible)]
MaybeDensity = Annotated[Density, Field(gt=0)] | None


class Elastic(Spec):
    """A hyperelastic material by its Young's modulus. density: needed under gravity only."""

    law: Literal["neo-hookean", "neo-hookean-log", "corotational", "st-venant-kirchhoff"] = "neo-hookean"
    young: Stress = Field(gt=0)
    poisson: Poisson
    density: MaybeDensity = None

    @property
    def shape(self) -> None:
        """Such a law has no numbers but these."""
        return None


class MooneyRivlin(Spec):
    """Mooney-Rivlin rubber, c10 (I1 - 3) + c01 (I2 - 3) of isochoric invariants, and a volumetric part; shear modulus
    2 (c10 + c01)."""

    law: Literal["mooney-rivlin"]
    c10: Stress
    c01: Stress
    poisson: Poisson
    density: MaybeDensity = None

    @model_validator(mode="after")
    def _stiff(self):
        _demand_stiffness("2 (c10 + c01)", self.shear)
        return self

    @property
    def shear(self) -> float:
        """MPa."""
        return 2 * (self.c10 + self.c01)

    @property
    def young(self) -> float:
        """MPa."""
        return 2 * self.shear * (1 + self.poisson)

    @property
    def shape(self) -> tuple[float, ...]:
        """Share of c01."""
        return (self.c01 / (self.c10 + self.c01),)


class Ogden(Spec):
    """Ogden rubber, sum of mu_i / alpha_i (l1^alpha_i + l2^alpha_i + l3^alpha_i - 3) of isochoric principal
    stretches l, and a volumetric part; shear modulus sum of mu_i alpha_i / 2."""

    law: Literal["ogden"]
    mu: StressVector
    alpha: list[float] = Field(min_length=1)
    poisson: Poisson
    density: MaybeDensity = None

    @model_validator(mode="after")
    def _stiff(self):
        if len(self.alpha) != len(self.mu):
            raise ValueError(f"mu and alpha must be as many, got {len(self.mu)} and {len(self.alpha)}")
        if not np.isfinite(self.alpha).all() or 0.0 in self.alpha:
            raise ValueError("alpha must be finite and not 0")
        _demand_stiffness("sum of mu_i alpha_i / 2", self.shear)
        return self

    @property
    def shear(self) -> float:
        """MPa."""
        return float(self.mu @ np.asarray(self.alpha)) / 2

    @property
    def young(self) -> float:
        """MPa."""
        return 2 * self.shear * (1 + self.poisson)

    @property
    def shape(self) -> tuple[float, ...]:
        """(w_1, alpha_1, w_2, alpha_2, ...): w_i the share of term i in the shear modulus."""
        share = self.mu * np.asarray(self.alpha) / (2 * self.shear)
        return tuple(float(number) for pair in zip(share, self.alpha, strict=True) for number in pair)


def _demand_stiffness(formula: str, shear: float) -> None:
    if not shear > 0:
        raise ValueError(f"the shear modulus, {formula}, must be positive, got {shear:g} MPa")


def _with_law(data: Any) -> Any:
    return {"law": "neo-hookean", **data} if isinstance(data, dict) else data


MaterialSpec = Annotated[
    Annotated[Elastic | MooneyRivlin | Ogden, Field(discriminator="law")], BeforeValidator(_with_law)
]


class MaterialRegion(Spec):
    """Another material for the cells whose centroid lies in `region`, or for a named cell set. Meshes that are made
    here (not read from a file, nor within an .stl) conform to a box, so that no cell straddles its faces; hexahedra, if
    the box is not askew to the bar."""

    region: Selection
    material: MaterialSpec

    @model_validator(mode="after")
    def _solid(self):
        if isinstance(self.region, Box) and not (self.region.high > self.region.low).all():
            raise ValueError("a box of no volume holds no material")
        return self
