"""Elastomers by name: constants with their range of stretch and their source. A scene says `material: {name: ...}`.

Fitted: by `cfem material fit CURVE --up-to 3 --slack` to 19 points each of a published tensile test, whose database is
under the Open Database License and so is no part of cfem. Published: the source's own constants. Makers state
density."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

_MARECHAL = (
    "tensile test of Marechal, Balland, Lindenroth, Petrou, Kontovounisios and Bello, Toward a Common Framework and "
    "Database of Materials for Soft Robotics, Soft Robotics 8(3), 2021, doi 10.1089/soro.2019.0115. Contains "
    "information from the Soft Robotics Materials Database, which is made available under the Open Database License "
    "(ODbL) 1.0"
)
_CROSSHEAD = (
    "Its strain is the crosshead's over 33 mm of gauge, the shoulders of the dumbbell included: true stretches are "
    "smaller, and the rubber is somewhat stiffer. Its first strain, where the specimen was slack, is taken off."
)
_SMOOTH_ON = "Smooth-On's technical bulletin"
POISSON = 0.499


@dataclass(frozen=True)
class Elastomer:
    """A rubber by name: constants of a law, their range and their source."""

    title: str
    constants: Mapping[str, Any]  # as a scene writes them, without Poisson's ratio and density
    density: str  # as a scene writes it
    density_source: str
    stretch: float | None  # up to which the constants hold in tension, None where the source does not say
    fitted: bool  # True: by us, False: published
    source: str
    caution: str
    others: tuple[tuple[float, float, str], ...] = ()  # (stretch, nominal stress in kPa, who says so)


def _fitted(title: str, density: str, modulus: float, **constants: Any) -> Elastomer:
    """Elastomer with constants fitted to Marechal's tests. modulus: kPa, the maker's nominal stress at a strain of 100
    %."""
    others = ((2.0, modulus, f"{_SMOOTH_ON} (100 % modulus)"),)
    frozen = MappingProxyType(constants)
    return Elastomer(title, frozen, density, _SMOOTH_ON, 3.0, True, _MARECHAL, _CROSSHEAD, others)


_PSI = 6.894757  # kPa

ELASTOMERS: Mapping[str, Elastomer] = MappingProxyType(
    {
        "dragon-skin-10": _fitted(
            "Dragon Skin 10 Medium", "1070 kg/m^3", 22 * _PSI, law="ogden", mu={"kPa": [28.86]}, alpha=[3.078]
        ),
        "dragon-skin-20": _fitted(
            "Dragon Skin 20", "1080 kg/m^3", 49 * _PSI, law="ogden", mu={"kPa": [92.66]}, alpha=[2.905]
        ),
        "dragon-skin-30": _fitted(
            "Dragon Skin 30", "1080 kg/m^3", 86 * _PSI, law="ogden", mu={"kPa": [131.9]}, alpha=[2.834]
        ),
        "ecoflex-00-10": _fitted("Ecoflex 00-10", "1040 kg/m^3", 8 * _PSI, law="yeoh", c1="3.701 kPa", c2="0.1268 kPa"),
        "ecoflex-00-30": _fitted(
            "Ecoflex 00-30", "1070 kg/m^3", 10 * _PSI, law="yeoh", c1="8.171 kPa", c2="0.0753 kPa"
        ),
        "ecoflex-00-50": _fitted(
            "Ecoflex 00-50", "1070 kg/m^3", 12 * _PSI, law="ogden", mu={"kPa": [17.06]}, alpha=[2.414]
        ),
        "elastosil-m4601": Elastomer(
            "Elastosil M4601",
            MappingProxyType({"law": "yeoh", "c1": "0.11 MPa", "c2": "0.02 MPa"}),
            "1130 kg/m^3",
            "Wacker's data sheet (ISO 2781)",
            None,
            False,
            "Mosadegh et al., Pneumatic Networks for Soft Robotics that Actuate Rapidly, Adv. Funct. Mater. 24, 2014, "
            "doi 10.1002/adfm.201303288, and the Soft Robotics Toolkit's models of PneuNets",
            "The source states no range of stretch.",
        ),
        "sylgard-184": Elastomer(
            "Sylgard 184 (PDMS, 10:1), cured at 25 degrees C",
            MappingProxyType({"law": "yeoh", "c1": "220 kPa"}),
            "1030 kg/m^3",
            "Dow's data sheet",
            None,
            False,
            "Johnston, McCluskey, Tan and Tracey, Mechanical characterization of bulk Sylgard 184 for microfluidics "
            "and microengineering, J. Micromech. Microeng. 24, 035017, 2014",
            "A Young's modulus of 1.32 MPa alone, as a neo-Hookean law: for small strains. Cured at 200 degrees C it "
            "is 2.97 MPa (`stiffness: 2.25`). Published moduli spread by far more (Varner and Cohen, Soft Matter 20, "
            "2024).",
        ),
    }
)
