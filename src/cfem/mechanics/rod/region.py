"""A rod of rigid sections as a region of a body: energy, forces on the sections, tangent stiffness.

Its energy is quadratic in the strains e of its elements (element.py): 1/2 e^T (C / h) e with
C = diag(E A, G A, G A, G J, E I_y, E I_z). Where its sections may contract and are of rubber, its fibres stiffen and
soften as fibres.py has it. Unknowns of a section are those of its rigid group (rigid_groups.py): translation, and
rotation vector times radius of gyration."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.mechanics.material.law import lame
from cfem.mechanics.rod.element import RodStrain, curvature, stretch
from cfem.mechanics.rod.fibres import beyond_linear
from cfem.mechanics.rod.sections import Sections

_FIBRES = [0, 4, 5]  # of a strain e: stretch and the two bendings


@dataclass(frozen=True)
class CrossSection:
    """A cross-section; each of the first three is one number, or (m,) one an element.

    area: A mm^2
    bending: I = I_y = I_z about the centroid, mm^4
    torsion: J mm^4
    contracts: whether the section may contract sideways where its fibres are stretched
    shear: share of G A that resists shear (Cowper, J. Appl. Mech. 33, 1966)"""

    area: float | np.ndarray
    bending: float | np.ndarray
    torsion: float | np.ndarray
    contracts: bool = False
    shear: float = 1.0

    def stiffness(self, young: float, poisson: float) -> np.ndarray:
        """Stiffness (6,) or (m, 6) N and N mm^2 of the section. The fibres of a section that cannot deform cannot
        contract sideways: they resist with lambda + 2 mu instead of Young's modulus."""
        lam, mu = lame(young, poisson)
        axial = young if self.contracts else lam + 2 * mu
        across, bend = self.shear * mu * self.area, axial * self.bending
        return np.stack([axial * self.area, across, across, mu * self.torsion, bend, bend], axis=-1)


@dataclass(frozen=True)
class Rod:
    """A rod of rigid sections.

    sections: that the rod joins, neighbours by m elements
    shape: of all
    stiffness: (m, 6) of C, N and N mm^2
    shear: (m,) MPa
    numbers: (m,) of each element's material among the body's
    rubber: (m,) Young's modulus (MPa) of the elements whose fibres are neo-Hookean, 0 of others; None without any"""

    sections: Sections
    shape: CrossSection
    stiffness: np.ndarray
    shear: np.ndarray
    numbers: np.ndarray
    rubber: np.ndarray | None = None

    @property
    def length(self) -> np.ndarray:
        """Lengths (m,) mm of the elements."""
        return self.sections.spacing


@dataclass(frozen=True)
class RodResponse:
    """Response of a rod at one place of its sections.

    energy: N mm
    strain: of the elements
    stress: (m, 6) N, N mm
    gradient: (m, 6, 12) of e by the unknowns of both sections
    scale: (m, 12) of the motions by the unknowns
    shortest: least stretch of the outermost fibres, <= 0 where sections touch
    bent: (m, 3, 3) stiffness of fibres of rubber beyond C / h, by the strains 0, 4 and 5 of e"""

    energy: float
    strain: RodStrain
    stress: np.ndarray
    gradient: np.ndarray
    scale: np.ndarray
    shortest: float
    bent: np.ndarray | None = None

    @property
    def force(self) -> np.ndarray:
        """Forces (m, 12) of each element on the unknowns of its two sections."""
        return (self.stress[:, None] @ self.gradient)[:, 0]


def make_rod(
    sections: Sections,
    shape: CrossSection,
    moduli: Sequence[tuple[float, float]],
    numbers: np.ndarray,
    rubber: Sequence[bool] = (),
) -> Rod:
    """Rod of sections.

    moduli: Young's (MPa) and Poisson's of each material
    numbers: (m,) which material an element has
    rubber: whether each material is, none unless given"""
    by_material = np.array([np.broadcast_to(shape.stiffness(*pair), (len(numbers), 6)) for pair in moduli])
    stiffness = by_material[numbers, np.arange(len(numbers))]
    shear = np.array([lame(*pair)[1] for pair in moduli])[numbers]
    fibres = None
    if shape.contracts and any(rubber):
        fibres = np.array([young * is_so for (young, _), is_so in zip(moduli, rubber, strict=True)])[numbers]
    return Rod(sections, shape, stiffness, shear, numbers, fibres)


def with_moduli(rod: Rod, moduli: Sequence[tuple[float, float]]) -> Rod:
    """The rod of other materials, in the order of those that it was made of."""
    count = len(moduli)
    rubber = [] if rod.rubber is None else [bool((rod.rubber[rod.numbers == i] > 0).any()) for i in range(count)]
    return make_rod(rod.sections, rod.shape, moduli, rod.numbers, rubber)


def response(rod: Rod, x: np.ndarray) -> RodResponse:
    """Response at positions x (n, 3) mm that keep the sections rigid."""
    c, R = rod.sections.frames(x)
    h, radius = rod.length, rod.sections.radius
    strain = stretch(c[:-1], R[:-1], c[1:], R[1:], h)
    stress = rod.stiffness * strain.e / h[:, None]
    scale = np.ones((len(h), 12))
    scale[:, 3:6], scale[:, 9:] = 1 / radius[:-1, None], 1 / radius[1:, None]
    bend = np.sqrt((strain.e[:, 4:] ** 2).sum(axis=1))
    outer = np.maximum(rod.sections.outer[:-1], rod.sections.outer[1:])
    shortest = float((1 + (strain.e[:, 0] - outer * bend) / h).min())
    energy, bent = float((stress * strain.e).sum() / 2), None
    if rod.rubber is not None:
        strains = strain.e[:, _FIBRES] / h[:, None]
        radius = 2 * np.sqrt(rod.shape.bending / rod.shape.area)
        extra = beyond_linear(strains[:, 0], strains[:, 1:], rod.rubber, rod.shape.area, radius)
        stress[:, _FIBRES] += extra.force
        energy, bent = energy + float(extra.energy @ h), extra.tangent / h[:, None, None]
    return RodResponse(energy, strain, stress, strain.gradient * scale[:, None], scale, shortest, bent)


def stiffness(rod: Rod, state: RodResponse, pulled: np.ndarray | float = 0.0) -> np.ndarray:
    """Stiffness (m, 12, 12) N/mm on the unknowns of both sections of each element, of the energy less pulled . e, with
    `pulled` (m, 6) held."""
    blocks = stiffness_of(rod.stiffness, state.stress - pulled, rod, state)
    if state.bent is not None:
        by_fibres = state.gradient[:, _FIBRES]
        blocks = blocks + by_fibres.swapaxes(1, 2) @ state.bent @ by_fibres
    return blocks


def stiffness_of(moduli: np.ndarray, stress: np.ndarray, rod: Rod, state: RodResponse) -> np.ndarray:
    """Stiffness (m, 12, 12) N/mm on the unknowns, of elements with these moduli (m, 6) as in C under this stress (m,
    6)."""
    material = moduli / rod.length[:, None]
    bent = curvature(state.strain, stress) * state.scale[:, :, None] * state.scale[:, None]
    return (state.gradient.swapaxes(1, 2) * material[:, None]) @ state.gradient + bent
