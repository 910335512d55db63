"""Hyperelastic laws by name. A new law is one file and one line here, and joins the whole test battery."""

from cfem.mechanics.material import corotational, neo_hookean
from cfem.mechanics.material.law import Law

LAWS: dict[str, Law] = {law.name: law for law in (neo_hookean.LAW, corotational.LAW)}

__all__ = ["LAWS", "Law"]
