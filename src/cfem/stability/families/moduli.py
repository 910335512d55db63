"""Stiffness from 1 kPa to 1 GPa, and contrasts of up to 1e6 between regions, or rigid parts in their place."""

from functools import partial
from itertools import product

import numpy as np

from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.element import ELEMENTS
from cfem.stability.bodies import bar, bar_body, bar_cables, robot, watched
from cfem.stability.case import AWAY, Case, converges, either
from cfem.stability.examine import attempt

YOUNG = {"1 kPa": 1e-3, "30 kPa": 0.03, "1 MPa": 1.0, "30 MPa": 30.0, "1 GPa": 1e3}
CONTRASTS = (1e-4, 1e3, 1e4, 1e6)
PLACES = {  # of centroids (m, 3) of the bar's cells
    "insert": lambda c: (c[:, 0] > 20) & (c[:, 0] < 40),
    "phalanges": lambda c: ((c[:, 0] > 10) & (c[:, 0] < 30)) | (c[:, 0] > 40),
    "layer": lambda c: c[:, 2] < 5 / 3,
}
LAYERED = {"tet4": (8, 2, 6), "tet10": (6, 1, 6), "tet10p0": (6, 1, 6), "hex8": (8, 2, 6)}
RIGID = {  # of nodes (n, 3)
    "insert": [lambda X: (X[:, 0] > 19) & (X[:, 0] < 41)],
    "phalanges": [lambda X: (X[:, 0] > 9) & (X[:, 0] < 31), lambda X: X[:, 0] > 39],
    "tip": [lambda X: X[:, 0] > 49],
}
ACTUATIONS = {"displacement": displacement([5.0, 3.0]), "force": force([0.5, 0.2])}


def cases() -> list[Case]:
    """Cases of one modulus, of contrasts between regions, and of rigid regions."""
    listed = []
    for (label, young), (how, actuation) in product(YOUNG.items(), ACTUATIONS.items()):
        scaled = force(young * actuation.offset) if how == "force" else actuation
        listed.append(Case(f"moduli/{label}/{how}", converges(), attempt(partial(_bar, young=young), scaled)))
    for place, contrast, element in product(PLACES, CONTRASTS, ELEMENTS):
        make = partial(_contrast, place, contrast, element)
        drawn = displacement([2.0] if place == "layer" else [3.0, 2.0])
        listed.append(Case(f"contrast/{place}/{contrast:g}/{element}", converges(), attempt(make, drawn)))
    listed += [
        Case(f"contrast/cable in a {kind} layer/{element}", either(*AWAY), attempt(make, displacement([3.0, 2.0])))
        for element in ELEMENTS
        for kind, make in {
            "soft": partial(_layered, 1e-4, element),
            "hard": partial(_layered, 1e3, element),
        }.items()
    ]
    for place, element, (how, actuation) in product(RIGID, ELEMENTS, ACTUATIONS.items()):
        make = partial(_rigid, place, element)
        listed.append(Case(f"contrast/rigid-{place}/{element}/{how}", converges(), attempt(make, actuation)))
    return listed


def _bar(**material) -> Robot:
    return bar(bar_body(**material))


def _contrast(place: str, contrast: float, element: str) -> Robot:
    """Bar with a region of another modulus; a layer is one of six cells across and has no cable in it."""
    divisions = LAYERED[element] if place == "layer" else None
    body = bar_body(element, divisions=divisions, regions=[(PLACES[place], contrast)])
    cables = bar_cables(body.mesh)[1:] if place == "layer" else bar_cables(body.mesh)
    return robot(body, cables, [watched(body.mesh, (60.0, 5.0, 5.0))])


def _layered(contrast: float, element: str) -> Robot:
    """Both cables drawn, one of them within the layer."""
    return bar(bar_body(element, divisions=LAYERED[element], regions=[(PLACES["layer"], contrast)]))


def _rigid(place: str, element: str) -> Robot:
    body = bar_body(element)
    return bar(body, rigid=tuple(np.flatnonzero(inside(body.mesh.X)) for inside in RIGID[place]))
