"""What a person reads of the elastomers that have a name."""

from typing import Any

import numpy as np

from cfem.core.shown import folded, stress
from cfem.robot.elastomers import ELASTOMERS, POISSON, Elastomer
from cfem.tensile.constants import as_yaml


def list_text() -> str:
    """One line an elastomer."""
    width = max(map(len, ELASTOMERS))
    lines = [f"{'name':<{width}}  {'E at rest':>10}  {'at stretch 2':>12}  {'density':<12} {'up to':<6} constants"]
    for name, one in ELASTOMERS.items():
        told = data_of(name)
        reach = "-" if one.stretch is None else f"{one.stretch:g}"
        lines.append(
            f"{name:<{width}}  {stress(told['young MPa']):>10}  {stress(told['stress at 2 MPa']):>12}  "
            f"{one.density:<12} {reach:<6} {'fitted' if one.fitted else 'published'}"
        )
    return "\n".join(
        [*lines, "", "up to: stretch in tension that the constants hold for, - where the source says none"]
    )


def data_of(name: str) -> dict[str, Any]:
    """Constants, what they give, range and sources."""
    from cfem.robot.build import as_material
    from cfem.robot.materials import read_material

    one = ELASTOMERS[name]
    made = as_material(read_material({"name": name}))
    return {
        "name": name,
        "title": one.title,
        "material": {**one.constants, "poisson": POISSON, "density": one.density},
        "young MPa": made.young,
        "stress at 2 MPa": tension(made, 2.0),
        "stretch": one.stretch,
        "fitted": one.fitted,
        "source": one.source,
        "density source": one.density_source,
        "caution": one.caution,
        "others": [{"stretch": at, "stress kPa": stress, "source": who} for at, stress, who in one.others],
    }


def show_text(name: str) -> str:
    """All that is known of one elastomer."""
    told, one = data_of(name), ELASTOMERS[name]
    young, pulled = stress(told["young MPa"]), stress(told["stress at 2 MPa"])
    lines = [
        f"Young's modulus at rest {young}, nominal stress {pulled} at a stretch of 2",
        _range(one),
        f"{'Fitted by us to the' if one.fitted else 'Published constants:'} {one.source}",
        one.caution,
        f"Density: {one.density_source}",
        *(f"Otherwise: {stress:.3g} kPa at a stretch of {at:g}, {who}" for at, stress, who in one.others),
    ]
    scene = f"material: {as_yaml(told['material'])}"
    return "\n".join([one.title, scene, *(part for line in lines for part in folded(line))])


def _range(one: Elastomer) -> str:
    if one.stretch is None:
        return "Range of stretch: not stated by the source"
    return f"Range of stretch: up to {one.stretch:g} in tension along one axis"


def tension(material: Any, stretch: float) -> float:
    """MPa: nominal stress along one axis at volume 1."""
    from cfem.mechanics.material.law import stress

    a = stretch
    F = np.diag([a, a**-0.5, a**-0.5])[None]
    P = stress(material.law, F, material.young, material.poisson, material.shape)[0]
    return float(P[0, 0] - P[1, 1] * a**-1.5)
