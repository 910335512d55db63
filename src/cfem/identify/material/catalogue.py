"""Text about the elastomers that have a name, for a person."""

from typing import Any

import numpy as np

from cfem.core.console.shown import folded, stress
from cfem.identify.material.constants import as_yaml
from cfem.robot.elastomers import ELASTOMERS, POISSON, Elastomer


def list_text() -> str:
    """Table of the elastomers, a line each."""
    width = max(map(len, ELASTOMERS))
    lines = [f"{'name':<{width}}  {'E at rest':>10}  {'at stretch 2':>12}  {'density':<12} {'up to':<6} constants"]
    for name, elastomer in ELASTOMERS.items():
        data = data_of(name)
        reach = "-" if elastomer.stretch is None else f"{elastomer.stretch:g}"
        lines.append(
            f"{name:<{width}}  {stress(data['young MPa']):>10}  {stress(data['stress at 2 MPa']):>12}  "
            f"{elastomer.density:<12} {reach:<6} {'fitted' if elastomer.fitted else 'published'}"
        )
    return "\n".join(
        [*lines, "", "up to: stretch in tension that the constants hold for, - where the source says none"]
    )


def data_of(name: str) -> dict[str, Any]:
    """Constants of an elastomer, what they give, range and sources."""
    from cfem.robot.build import as_material
    from cfem.robot.materials import read_material

    elastomer = ELASTOMERS[name]
    material = as_material(read_material({"name": name}))
    return {
        "name": name,
        "title": elastomer.title,
        "material": {**elastomer.constants, "poisson": POISSON, "density": elastomer.density},
        "young MPa": material.young,
        "stress at 2 MPa": tension(material, 2.0),
        "stretch": elastomer.stretch,
        "fitted": elastomer.fitted,
        "source": elastomer.source,
        "density source": elastomer.density_source,
        "caution": elastomer.caution,
        "others": [
            {"stretch": stretch, "stress kPa": kpa, "source": source} for stretch, kpa, source in elastomer.others
        ],
    }


def show_text(name: str) -> str:
    """Text of all that is known of an elastomer."""
    data, elastomer = data_of(name), ELASTOMERS[name]
    young, pulled = stress(data["young MPa"]), stress(data["stress at 2 MPa"])
    lines = [
        f"Young's modulus at rest {young}, nominal stress {pulled} at a stretch of 2",
        _range(elastomer),
        f"{'Fitted by us to the' if elastomer.fitted else 'Published constants:'} {elastomer.source}",
        elastomer.caution,
        f"Density: {elastomer.density_source}",
        *(f"Otherwise: {kpa:.3g} kPa at a stretch of {stretch:g}, {who}" for stretch, kpa, who in elastomer.others),
    ]
    scene = f"material: {as_yaml(data['material'])}"
    return "\n".join([elastomer.title, scene, *(part for line in lines for part in folded(line))])


def _range(elastomer: Elastomer) -> str:
    if elastomer.stretch is None:
        return "Range of stretch: not stated by the source"
    return f"Range of stretch: up to {elastomer.stretch:g} in tension along one axis"


def tension(material: Any, stretch: float) -> float:
    """Nominal stress MPa along one axis at volume 1."""
    from cfem.mechanics.material.law import stress

    F = np.diag([stretch, stretch**-0.5, stretch**-0.5])[None]
    P = stress(material.law, F, material.young, material.poisson, material.shape)[0]
    return float(P[0, 0] - P[1, 1] * stretch**-1.5)
