"""A rod of rigid sections as a region of a body: energy, forces on the sections, tangent stiffness.

Its strains are quadratic in energy, E = 1/2 e^T (C / h) e with e of rod.py and C = diag(E A, G A, G A, G J, E I_y,
E I_z). Unknowns of a section are those of its rigid group (rigid.py): translation, and rotation vector times radius of
gyration."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cfem.mechanics.material.law import lame
from cfem.mechanics.rod import Stretch, curvature, stretch
from cfem.mechanics.sections import Sections


@dataclass(frozen=True)
class Section:
    """area A mm^2; bending I = I_y = I_z about the centroid, mm^4; torsion J mm^4."""

    area: float
    bending: float
    torsion: float

    def stiffness(self, young: float, poisson: float) -> np.ndarray:
        """(6,) N and N mm^2 of a section that cannot deform, so that its fibres cannot contract sideways: they resist
        with lambda + 2 mu instead of Young's modulus."""
        lam, mu = lame(young, poisson)
        axial = lam + 2 * mu
        return np.array(
            [axial * self.area, mu * self.area, mu * self.area]
            + [mu * self.torsion, axial * self.bending, axial * self.bending]
        )


@dataclass(frozen=True)
class Beam:
    """sections: that the rod joins, neighbours by m elements; shape: of all; stiffness: (m, 6) of C, N and N mm^2;
    shear: (m,) MPa; numbers: (m,) of each element's material among the body's."""

    sections: Sections
    shape: Section
    stiffness: np.ndarray
    shear: np.ndarray
    numbers: np.ndarray

    @property
    def length(self) -> np.ndarray:
        """(m,) mm of the elements."""
        return self.sections.apart


@dataclass(frozen=True)
class BeamResponse:
    """energy N mm; strain: of the elements; stress (m, 6): N, N mm; gradient (m, 6, 12): of e by the unknowns of both
    sections; scale (m, 12): of the motions by the unknowns; shortest: least stretch of the outermost fibres, <= 0 where
    sections touch."""

    energy: float
    strain: Stretch
    stress: np.ndarray
    gradient: np.ndarray
    scale: np.ndarray
    shortest: float

    @property
    def force(self) -> np.ndarray:
        """(m, 12) of each element on the unknowns of its two sections."""
        return (self.stress[:, None] @ self.gradient)[:, 0]


def make_beam(sections: Sections, shape: Section, moduli: Sequence[tuple[float, float]], numbers: np.ndarray) -> Beam:
    """moduli: Young's (MPa) and Poisson's of each material; numbers (m,): which one an element is of."""
    stiffness = np.array([shape.stiffness(*each) for each in moduli])[numbers]
    shear = np.array([lame(*each)[1] for each in moduli])[numbers]
    return Beam(sections, shape, stiffness, shear, numbers)


def with_moduli(beam: Beam, moduli: Sequence[tuple[float, float]]) -> Beam:
    """The beam of other materials, in the order of those that it was made of."""
    return make_beam(beam.sections, beam.shape, moduli, beam.numbers)


def response(beam: Beam, x: np.ndarray) -> BeamResponse:
    """At positions x (n, 3) mm that keep the sections rigid."""
    c, R = beam.sections.frames(x)
    h, radius = beam.length, beam.sections.radius
    found = stretch(c[:-1], R[:-1], c[1:], R[1:], h)
    stress = beam.stiffness * found.e / h[:, None]
    scale = np.ones((len(h), 12))
    scale[:, 3:6], scale[:, 9:] = 1 / radius[:-1, None], 1 / radius[1:, None]
    bend = np.sqrt((found.e[:, 4:] ** 2).sum(axis=1))
    shortest = float((1 + (found.e[:, 0] - beam.sections.outer * bend) / h).min())
    energy = float((stress * found.e).sum() / 2)
    return BeamResponse(energy, found, stress, found.gradient * scale[:, None], scale, shortest)


def stiffness(beam: Beam, at: BeamResponse, pulled: np.ndarray | float = 0.0) -> np.ndarray:
    """(m, 12, 12) N/mm on the unknowns of both sections of each element, of the energy less pulled . e, with `pulled`
    (m, 6) held."""
    return stiffness_of(beam.stiffness, at.stress - pulled, beam, at)


def stiffness_of(moduli: np.ndarray, stress: np.ndarray, beam: Beam, at: BeamResponse) -> np.ndarray:
    """(m, 12, 12) N/mm on the unknowns, of elements with these moduli (m, 6) as in C under this stress (m, 6)."""
    material = moduli / beam.length[:, None]
    bent = curvature(at.strain, stress) * at.scale[:, :, None] * at.scale[:, None]
    return (at.gradient.swapaxes(1, 2) * material[:, None]) @ at.gradient + bent
