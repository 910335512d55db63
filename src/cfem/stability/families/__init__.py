"""The families of cases, one file each: tables of what varies."""

from cfem.stability.case import Case
from cfem.stability.families import (
    buckling,
    cables,
    chambers,
    constraints,
    faults,
    incompressible,
    large,
    loads,
    moduli,
    programs,
    slivers,
)


def built_in() -> list[Case]:
    """All cases on built-in bodies, in the order in which they run."""
    families = (
        incompressible,
        moduli,
        slivers,
        cables,
        chambers,
        buckling,
        loads,
        constraints,
        faults,
        programs,
        large,
    )
    return [case for family in families for case in family.cases()]
