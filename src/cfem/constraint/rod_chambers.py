"""Chambers along a rod whose sections do not deform: delta = V - V0 in mm^3; the multiplier is the pressure in MPa.

A plane section sweeps the volume A n . dr/ds ds at the centroid r of the chamber (the theorem of Pappus), so that the
growth is linear in the strains (gamma, kappa) of the rod, and on an element of constant strain
(mechanics/rod/element.py) in e:

    V = int A (1 + gamma_x + kappa_y z - kappa_z y) ds = sum over elements, A (h + e . (1, 0, 0, 0, z, -y))"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from cfem.constraint.rod_row import RodRow, Strained
from cfem.mechanics.rod.region import Rod


@dataclass(frozen=True)
class RodChambers(RodRow):
    """Chambers along a rod. weights (m, 6): d delta / d e, mm^2 and mm^3."""

    weights: np.ndarray
    units: ClassVar[tuple[str, str]] = ("mm^3", "MPa")

    def strained(self, e: np.ndarray) -> Strained:
        """Volume and its derivatives at the strains e (m, 6) of the rod."""
        return Strained(float((self.weights * e).sum()), self.weights)


def make_rod_chambers(rod: Rod, centres: np.ndarray, area: float, elements: np.ndarray) -> RodChambers:
    """Chambers (k,) of one pressure, each of `area` mm^2 along `elements`, centred at (y, z) of `centres` (k, 2) mm."""
    weights = np.zeros((len(rod.length), 6))
    y, z = np.asarray(centres).T
    weights[elements] = area * np.array([len(y), 0.0, 0.0, 0.0, z.sum(), -y.sum()])
    return RodChambers(rod, weights)
