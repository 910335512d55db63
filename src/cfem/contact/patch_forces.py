"""One round of a contact step: the law of contact, linear about where the patches are."""

from dataclasses import dataclass

import numpy as np

from cfem.contact.enumerate import MOST
from cfem.contact.modes import Mode
from cfem.contact.newton import modes_from, newton, projected
from cfem.contact.path import along_friction
from cfem.contact.problem import ContactProblem
from cfem.contact.solve import ContactStatus, solve_contact


@dataclass(frozen=True, eq=False)
class TurningCompliance:
    """Compliance of c patches, C, corrected for forces that turn with their places, df/dx = B.

    compliance: (3 c, 3 c) mm/N, (C^-1 - B)^-1: motion by the forces before they turn
    turning: (3 c, 3 c), B (C^-1 - B)^-1: change of the forces, for the same forces"""

    compliance: np.ndarray
    turning: np.ndarray


def turned(compliance: np.ndarray, turning: np.ndarray) -> TurningCompliance | None:
    """Compliance of patches with `compliance` C (3 c, 3 c) mm/N whose forces turn by B = `turning` (c, 3, 3) N/mm with
    their places; None where it is not positive definite."""
    c = len(turning)
    B = np.zeros((c, 3, c, 3))
    B[np.arange(c), :, np.arange(c)] = turning
    B = B.reshape(3 * c, 3 * c)
    effective = np.linalg.solve(np.eye(3 * c) - compliance @ B, compliance)
    try:
        np.linalg.cholesky((effective + effective.T) / 2)
    except np.linalg.LinAlgError:
        return None
    return TurningCompliance(effective, B @ effective)


def pressed(
    compliance: np.ndarray, gap: np.ndarray, frames: np.ndarray, start: np.ndarray, mu: float
) -> tuple[tuple[Mode, ...], np.ndarray] | None:
    """Modes, and forces (c, 3) N in their `frames` (c, 3, 3), of patches by the law of contact; None where none obey
    it.

    compliance (3 c, 3 c) mm/N: of the patches, in the scene's axes
    gap (c, 3) mm: normal gap and slip in the frames, under forces `start` (c, 3) N"""
    c = len(frames)
    shape = (c, 3, 3 * c)
    W = (frames @ (frames @ compliance.T.reshape(shape)).reshape(3 * c, 3 * c).T.reshape(shape)).reshape(3 * c, 3 * c)
    free = gap.ravel() - W @ start.ravel()
    forces, _ = newton(W, free, mu, start)
    if forces is None and c <= MOST:  # the state that `solve_contact` finds of more points, and C of any number
        forces, _ = newton(W, free, mu)
        forces = along_friction(W, free, mu)[0] if forces is None else forces
    if forces is not None:
        return modes_from(forces, mu), forces
    answer = solve_contact(ContactProblem(W, free, mu=mu), "coulomb")
    if answer.status not in (ContactStatus.SOLVED, ContactStatus.SEVERAL):
        return None
    return answer.modes, answer.lam.reshape(-1, 3)


def violation(forces: np.ndarray, gap: np.ndarray, compliance: np.ndarray, mu: float) -> float:
    """Largest distance, mm, of patches from the law of contact, at forces (c, 3) N and gaps (c, 3) mm, both in the
    frames of the surfaces there: by how much forces differ from their projection (`cfem.contact.newton`), times what a
    patch yields, of compliance (3 c, 3 c) mm/N. A force of 0 has no violation where its gap is open."""
    flexibility = compliance.diagonal().reshape(-1, 3).max(axis=1)[:, None]
    lawful, _ = projected(forces - gap / flexibility, mu)
    return float(np.linalg.norm(flexibility * (forces - lawful), axis=1).max())


@dataclass(frozen=True, eq=False)
class Balance:
    """Forces that obey the law on one linearisation.

    modes: of the p pairs
    local: (p, 3) N, forces of the pairs in their frames
    push: (p, 3) N, the same in the scene, on the pairs' patches
    forces: (c, 3) N, on the patches
    change: (c, 3) N, of these forces
    compliance: (3 c, 3 c) mm/N, of the patches"""

    modes: tuple[Mode, ...]
    local: np.ndarray
    push: np.ndarray
    forces: np.ndarray
    change: np.ndarray
    compliance: np.ndarray

    @property
    def step(self) -> np.ndarray:
        """(c, 3) mm by which the change of the forces moves the patches."""
        return (self.compliance @ self.change.ravel()).reshape(-1, 3)


def balance(
    relative: np.ndarray | None,
    frames: np.ndarray,
    compliance: np.ndarray,
    gaps: np.ndarray,
    forces: np.ndarray,
    push: np.ndarray,
    mu: float,
    mobility: np.ndarray | None = None,
) -> Balance | None:
    """The law of contact on p pairs of c patches with `compliance` (3 c, 3 c) mm/N in the scene's axes, under forces
    (c, 3) N; None where nothing obeys it.

    relative (p, c): how pairs depend on the patches (`Pairs.relative`), None where each patch has one, in their order
    frames (p, 3, 3), and in these gaps (p, 3) mm: normal gap and slip
    push (p, 3) N: a guess in the scene; `forces` where relative is None
    mobility (3 p, 3 p) mm/N: by how much the pairs yield beside the patches, as the bodies move that they are on"""
    if not len(frames):
        return Balance((), np.zeros((0, 3)), np.zeros((0, 3)), 0 * forces, -forces, compliance)
    guess, pair_compliance = (frames @ push[:, :, None])[..., 0], compliance
    if relative is not None:
        B = np.kron(relative, np.eye(3))
        by_patches = B @ compliance
        pair_compliance = by_patches @ B.T
        unguessed = by_patches @ (forces.ravel() - B.T @ push.ravel())  # mm, by forces that are not of the guess
        gaps = gaps - (frames @ unguessed.reshape(-1, 3, 1))[..., 0]
    if mobility is not None:
        pair_compliance = pair_compliance + mobility
    answer = pressed(pair_compliance, gaps, frames, guess, mu)
    if answer is None:
        return None
    modes, local = answer
    pushes = (local[:, None] @ frames)[:, 0]
    balanced = pushes if relative is None else (B.T @ pushes.ravel()).reshape(-1, 3)
    return Balance(modes, local, pushes, balanced, balanced - forces, compliance)
