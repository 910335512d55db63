"""Poisson's ratio towards 1/2, for every element and law."""

from functools import partial
from itertools import product

from cfem.core.errors import InputError
from cfem.equilibrium.system.actuation import displacement
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.stability.bodies import bar, bar_body
from cfem.stability.case import Case, converges, refuses
from cfem.stability.examine import attempt

POISSON = (0.3, 0.4, 0.45, 0.49, 0.499, 0.4999)


def cases() -> list[Case]:
    """Cases of a bar for each element, law and Poisson's ratio."""
    return [
        Case(
            f"incompressible/{element}/{law}/{poisson}",
            refuses(InputError, "beyond nu") if ELEMENTS[element].bubbles and poisson > 0.499 else converges(),
            attempt(partial(_bar, element, law, poisson), displacement([5.0, 3.0])),
        )
        for element, law, poisson in product(ELEMENTS, LAWS, POISSON)
    ]


def _bar(element: str, law: str, poisson: float):
    return bar(bar_body(element, law, poisson=poisson))
