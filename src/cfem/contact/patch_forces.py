"""One round of a touched robot: the law of contact, linear about where its patches are."""

import numpy as np

from cfem.contact.enumerate import MOST
from cfem.contact.modes import Mode
from cfem.contact.newton import modes_from, newton, projected
from cfem.contact.path import along_friction
from cfem.contact.problem import ContactProblem
from cfem.contact.solve import ContactStatus, solve_contact


def turned(compliance: np.ndarray, turning: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Of patches whose forces turn by B = `turning` (c, 3, 3) N/mm with their places: the compliance (3 c, 3 c) mm/N
    with that in it, (C^-1 - B)^-1, and by how much forces turn, B (C^-1 - B)^-1. None where the former is not positive
    definite."""
    c = len(turning)
    B = np.zeros((c, 3, c, 3))
    B[np.arange(c), :, np.arange(c)] = turning
    B = B.reshape(3 * c, 3 * c)
    found = np.linalg.solve(np.eye(3 * c) - compliance @ B, compliance)
    try:
        np.linalg.cholesky((found + found.T) / 2)
    except np.linalg.LinAlgError:
        return None
    return found, B @ found


def pressed(
    compliance: np.ndarray, gap: np.ndarray, into: np.ndarray, known: np.ndarray, mu: float
) -> tuple[tuple[Mode, ...], np.ndarray] | None:
    """Modes, and forces (c, 3) N in the frames `into` (c, 3, 3), of patches with `compliance` (3 c, 3 c) mm/N that, in
    these frames, are `gap` (c, 3) mm from what they meet and from where they last stuck, under forces `known` (c, 3)
    N. None where nothing obeys the law."""
    c = len(into)
    shape = (c, 3, 3 * c)
    W = (into @ (into @ compliance.T.reshape(shape)).reshape(3 * c, 3 * c).T.reshape(shape)).reshape(3 * c, 3 * c)
    free = gap.ravel() - W @ known.ravel()
    found, _ = newton(W, free, mu, known)
    if found is None and c <= MOST:  # the state that `solve_contact` finds of more points, and C of any number
        found, _ = newton(W, free, mu)
        found = along_friction(W, free, mu)[0] if found is None else found
    if found is not None:
        return modes_from(found, mu), found
    answer = solve_contact(ContactProblem(W, free, mu=mu), "coulomb")
    if answer.status not in (ContactStatus.SOLVED, ContactStatus.SEVERAL):
        return None
    return answer.modes, answer.lam.reshape(-1, 3)


def violation(forces: np.ndarray, gap: np.ndarray, compliance: np.ndarray, mu: float) -> float:
    """mm: the largest distance of patches from the law of contact, at forces (c, 3) N and gaps (c, 3) mm, both in the
    frames of the surfaces there: by how much forces differ from their projection (`cfem.contact.newton`), times what a
    patch yields, of compliance (3 c, 3 c) mm/N. A force of 0 has no violation where its gap is open."""
    yields = compliance.diagonal().reshape(-1, 3).max(axis=1)[:, None]
    lawful, _ = projected(forces - gap / yields, mu)
    return float(np.linalg.norm(yields * (forces - lawful), axis=1).max())
