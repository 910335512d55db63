"""Cells that are flat: a squeezed layer of cells in a bar, and a thin plate."""

from functools import partial
from itertools import product

import numpy as np

from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.stability.bodies import BAR, COARSE, SOFT, bar, bar_body, box, cable, robot, watched
from cfem.stability.case import Case, converges
from cfem.stability.examine import attempt

ASPECTS = (1e2, 1e4, 1e6)
THIN = {"tet10p0": (10, 6, 1), "tet10": (10, 6, 1), "hex8": (12, 8, 1), "tet4": (12, 8, 1)}
LOADS = {"displacement": displacement([8.0]), "force": force([1e-3])}


def cases() -> list[Case]:
    """Cases of squeezed layers and of a thin plate."""
    listed = [
        Case(
            f"slivers/{aspect:g}/{element}/{how}",
            converges(),
            attempt(partial(_squeezed, aspect, element), actuation),
        )
        for aspect, element, (how, actuation) in product(
            ASPECTS, ELEMENTS, {"displacement": displacement([4.0, 2.0]), "force": force([0.5, 0.2])}.items()
        )
    ]
    listed += [
        Case(f"slivers/plate 100:1/{element}/{how}", converges(), attempt(partial(_plate, element), actuation))
        for element, (how, actuation) in product(THIN, LOADS.items())
    ]
    return listed


def _squeezed(aspect: float, element: str) -> Robot:
    """The third layer of cells along the bar squeezed to 1/aspect of its thickness, the rest stretched to fill."""
    divisions = COARSE[element]
    stops = np.linspace(0, BAR[0], divisions[0] + 1)
    widths = np.diff(stops)
    widths[2] /= aspect
    widths *= BAR[0] / widths.sum()
    moved = np.concatenate([[0], np.cumsum(widths)])
    moved[-1] = BAR[0]

    def squeeze(X: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(X[:, 0], stops, moved), X[:, 1:]])

    return bar(bar_body(element, divisions=divisions, bend=squeeze))


def _plate(element: str) -> Robot:
    """Robot of 100 x 60 x 1 mm, held at one edge, its free edge pulled upwards."""
    mesh = box((100.0, 60.0, 1.0), THIN[element], element)
    lift = cable(mesh, [(95.0, 30.0, 0.5)], (95.0, 30.0, 200.0))
    return robot(make_body(mesh, ELEMENTS[element], SOFT), [lift], [watched(mesh, (99.0, 30.0, 0.5))])
