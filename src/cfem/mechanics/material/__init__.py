"""Hyperelastic laws by name. A new law is one file and one line here, and joins the whole test battery."""

from cfem.mechanics.material import (
    corotational,
    mooney_rivlin,
    neo_hookean,
    neo_hookean_log,
    ogden,
    st_venant_kirchhoff,
    yeoh,
)
from cfem.mechanics.material.law import Law, Material

LAWS: dict[str, Law] = {
    law.name: law
    for law in (
        neo_hookean.LAW,
        neo_hookean_log.LAW,
        corotational.LAW,
        st_venant_kirchhoff.LAW,
        mooney_rivlin.LAW,
        ogden.LAW,
        yeoh.LAW,
    )
}

__all__ = ["LAWS", "Law", "Material"]
