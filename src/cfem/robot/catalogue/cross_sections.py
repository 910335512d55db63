"""Cross sections of the bodies of the catalogue that may be rods."""

import numpy as np

from cfem.mechanics.rod.region import CrossSection
from cfem.robot.catalogue.stiff_flop import CHAMBERS, StiffFlop, polygon
from cfem.robot.catalogue.taper import Taper

_GAUSS = (np.array([-1, 0, 1]) * np.sqrt(0.6), np.array([5, 8, 5]) / 18)


def stiff_flop_section(geometry: StiffFlop) -> CrossSection:
    """Cross section of the polygons; its torsion constant is 2 I, as of plane sections that do not warp."""
    outer, bore, chamber = (
        polygon(radius) for radius in (geometry.radius, geometry.bore_radius, geometry.chamber_radius)
    )
    area = outer[0] - bore[0] - CHAMBERS * chamber[0]
    # six equal areas on a circle have half of their polar moment about either axis
    bending = outer[1] - bore[1] - CHAMBERS * (chamber[1] + chamber[0] * geometry.chamber_circle**2 / 2)
    return CrossSection(area, bending, 2 * bending)


def cross_section(geometry: StiffFlop | Taper, places: np.ndarray, poisson: float) -> CrossSection:
    """Cross sections of a rod whose sections are at `places` (s,) mm, of the main material."""
    if isinstance(geometry, StiffFlop):
        return stiff_flop_section(geometry)
    return _taper_section(geometry, places, poisson)


def _taper_section(spec: Taper, places: np.ndarray, poisson: float) -> CrossSection:
    """Mean cross section of each element between neighbouring `places` (s,) mm, by Gauss's rule of three points.
    Sections are free to contract; shear as Cowper's for a circle of the main material."""
    middle, half = (places[1:] + places[:-1]) / 2, np.diff(places) / 2
    radii = np.interp(middle[:, None] + half[:, None] * _GAUSS[0], spec.places, spec.radii)
    area, bending = np.pi * radii**2 @ _GAUSS[1], np.pi / 4 * radii**4 @ _GAUSS[1]
    return CrossSection(area, bending, 2 * bending, True, 6 * (1 + poisson) / (7 + 6 * poisson))
