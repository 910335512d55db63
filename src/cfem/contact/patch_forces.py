"""One round of a contact step: the law of contact, linear about where the patches are."""

from dataclasses import dataclass, replace

import numpy as np
from numba import njit

from cfem.contact.law.modes import Mode
from cfem.contact.law.newton import modes_from, newton, project
from cfem.contact.law.path import along_friction
from cfem.contact.law.problem import ContactProblem
from cfem.contact.law.sliding import StepBegin, slid
from cfem.contact.law.solve import MOST, ContactStatus, solve_contact


@dataclass(frozen=True, eq=False)
class TurningCompliance:
    """Compliance of c patches, C, corrected for forces that turn with their places, df/dx = B.

    compliance: (3 c, 3 c) mm/N, (C^-1 - B)^-1: motion by the forces before they turn
    turning: (3 c, 3 c), B (C^-1 - B)^-1: change of the forces, for the same forces
    by_place: (c, 3, 3) N/mm, blocks of B"""

    compliance: np.ndarray
    turning: np.ndarray
    by_place: np.ndarray


def turned(compliance: np.ndarray, turning: np.ndarray) -> TurningCompliance | None:
    """Compliance of patches with `compliance` C (3 c, 3 c) mm/N whose forces turn by B = `turning` (c, 3, 3) N/mm with
    their places; None where it is not positive definite."""
    turn = np.flatnonzero(turning.any(axis=(1, 2)))
    n, rows, B = len(compliance), (3 * turn[:, None] + np.arange(3)).ravel(), turning[turn]
    by_turn = (compliance[:, rows].reshape(n, -1, 1, 3) @ B).reshape(n, -1)
    turned_rows = np.linalg.solve(np.eye(len(rows)) - by_turn[rows], compliance[rows])  # of the patches that turn alone
    effective, change = compliance + by_turn @ turned_rows, np.zeros((n, n))
    change[rows] = (B @ turned_rows.reshape(-1, 3, n)).reshape(-1, n)
    try:
        np.linalg.cholesky((effective + effective.T) / 2)
    except np.linalg.LinAlgError:
        return None
    return TurningCompliance(effective, change, turning)


def pressed(
    compliance: np.ndarray,
    gap: np.ndarray,
    frames: np.ndarray,
    start: np.ndarray,
    mu: float,
    begin: StepBegin | None = None,
) -> tuple[tuple[Mode, ...], np.ndarray, np.ndarray] | None:
    """Modes, forces (c, 3) N in their `frames` (c, 3, 3), and slip (c, 2) mm before the last part of the step, of
    patches by the law of contact; None where none obey it.

    compliance (3 c, 3 c) mm/N: of the patches, in the scene's axes
    gap (c, 3) mm: normal gap and slip in the frames, under forces `start` (c, 3) N
    begin: of the step, where friction is followed along it"""
    W, free = in_frames(compliance, gap, frames, start)
    slip = np.zeros((len(frames), 2))
    if begin is not None and mu:
        slip = slid(W, free, begin.gaps, (frames @ begin.push[:, :, None])[..., 0], mu, begin.parts)
        free.reshape(-1, 3)[:, 1:] -= slip
    forces, _ = newton(W, free, mu, start)
    if (
        forces is None and len(frames) <= MOST
    ):  # the state that `solve_contact` finds of more points, and C of any number
        forces, _ = newton(W, free, mu)
        forces = along_friction(W, free, mu)[0] if forces is None else forces
    if forces is not None:
        return modes_from(forces, mu), forces, slip
    answer = solve_contact(ContactProblem(W, free, mu=mu), "coulomb")
    if answer.status is not ContactStatus.SOLVED:
        return None
    return answer.modes, answer.lam.reshape(-1, 3), slip


@njit(cache=True, error_model="numpy")
def in_frames(compliance, gap, frames, start):
    """Contact problem W (3 c, 3 c) mm/N and free (3 c,) mm (`cfem.contact.law.problem`) in the frames of the patches,
    from the arguments of `pressed`."""
    n, half = 3 * len(frames), np.empty((3, 3))
    W, free = np.empty((n, n)), gap.copy().reshape(-1)
    for i in range(0, n, 3):
        for j in range(0, n, 3):
            F, G = frames[i // 3], frames[j // 3]
            for a in range(3):
                for b in range(3):
                    half[a, b] = 0.0
                    for d in range(3):
                        half[a, b] += F[a, d] * compliance[i + d, j + b]
            for a in range(3):
                for b in range(3):
                    W[i + a, j + b] = half[a, 0] * G[b, 0] + half[a, 1] * G[b, 1] + half[a, 2] * G[b, 2]
                    free[i + a] -= W[i + a, j + b] * start[j // 3, b]
    return W, free


@njit(cache=True, error_model="numpy")
def violation(forces, gap, compliance, mu):
    """Largest distance, mm, of patches from the law of contact, at forces (c, 3) N and gaps (c, 3) mm, both in the
    frames of the surfaces there: by how much forces differ from their projection (`cfem.contact.law.newton`), times
    what a patch yields, by the diagonal of a compliance (3 c, 3 c) mm/N. A force of 0 has no violation where its gap is
    open."""
    largest, p, D = 0.0, np.empty(3), np.empty((3, 3))
    for i in range(len(forces)):
        flexibility = max(compliance[3 * i, 3 * i], compliance[3 * i + 1, 3 * i + 1], compliance[3 * i + 2, 3 * i + 2])
        for a in range(3):
            p[a] = forces[i, a] - gap[i, a] / flexibility
        project(p, mu, D)
        square = 0.0
        for a in range(3):
            square += (flexibility * (forces[i, a] - p[a])) ** 2
        largest = max(largest, np.sqrt(square)) if np.isfinite(square) else np.inf
    return largest


@njit(cache=True, error_model="numpy")
def lawful(local, push, sticks, frames, gaps, compliance, places, by_bodies, mu):
    """Forces (d, 3) N of patches in the scene by the frames (d, 3, 3) of the surfaces where they have come to; by how
    much they miss the law there, mm; how far they move as they turn with the frames, mm; and by how much friction is
    beyond its limit, N.

    local, push: (d, 3) N in the frames before, and in the scene; sticks (d,) bool: patches whose force stays in the
    scene, and does not turn with its frame
    gaps: (d, 3) mm there
    compliance: (3 c, 3 c) mm/N, of patches among which these have places (d,)
    by_bodies: (3 d, 3 d) mm/N, what the motion of rigid bodies adds to it; of size 0 without"""
    d, by_forces, by_motion, beyond, turns = len(local), 0.0, 0.0, -np.inf, False
    by_law, in_frame, flexibility = np.zeros((d, 3)), local.copy(), np.zeros((3 * d, 3 * d))
    for i in range(d):
        for a in range(3):
            for b in range(3):
                by_law[i, a] += local[i, b] * frames[i, b, a]
        if sticks[i]:
            for a in range(3):
                by_law[i, a] = push[i, a]
                in_frame[i, a] = (
                    frames[i, a, 0] * push[i, 0] + frames[i, a, 1] * push[i, 1] + frames[i, a, 2] * push[i, 2]
                )
        beyond = max(beyond, np.sqrt(in_frame[i, 1] ** 2 + in_frame[i, 2] ** 2) - mu * in_frame[i, 0])
        for a in range(3):
            turns |= by_law[i, a] != push[i, a]
    for row in range(len(compliance) if turns else 0):
        change = 0.0
        for j in range(d):
            for b in range(3):
                change += compliance[row, 3 * places[j] + b] * (by_law[j, b] - push[j, b])
        by_forces = max(by_forces, abs(change))
    for i in range(3 * d):
        mine, change = 3 * places[i // 3] + i % 3, 0.0
        flexibility[i, i] = compliance[mine, mine]
        if len(by_bodies):
            flexibility[i, i] += by_bodies[i, i]
            for j in range(3 * d if turns else 0):
                change += by_bodies[i, j] * (by_law[j // 3, j % 3] - push[j // 3, j % 3])
        by_motion = max(by_motion, abs(change))
    return by_law, violation(in_frame, gaps, flexibility, mu), by_forces + by_motion, beyond


@dataclass(frozen=True, eq=False)
class Balance:
    """Forces that obey the law on one linearisation.

    modes: of the p pairs
    local: (p, 3) N, forces of the pairs in their frames
    push: (p, 3) N, the same in the scene, on the pairs' patches
    forces: (c, 3) N, on the patches
    change: (c, 3) N, of these forces
    compliance: (3 c, 3 c) mm/N, of the patches
    slid: (p, 3) mm in the scene, along the surfaces before the last part of the step"""

    modes: tuple[Mode, ...]
    local: np.ndarray
    push: np.ndarray
    forces: np.ndarray
    change: np.ndarray
    compliance: np.ndarray
    slid: np.ndarray

    def with_forces(self, push: np.ndarray, forces: np.ndarray, frames: np.ndarray, mu: float) -> "Balance":
        """Other forces on the same linearisation, push (p, 3) N of pairs and forces (c, 3) N on patches, which need not
        obey the law."""
        local = (frames @ push[:, :, None])[..., 0]
        change = self.change + forces - self.forces
        return replace(self, modes=modes_from(local, mu), local=local, push=push, forces=forces, change=change)

    @property
    def step(self) -> np.ndarray:
        """Step (c, 3) mm by which the change of the forces moves the patches."""
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
    begin: StepBegin | None = None,
) -> Balance | None:
    """The law of contact on p pairs of c patches with `compliance` (3 c, 3 c) mm/N in the scene's axes, under forces
    (c, 3) N; None where nothing obeys it.

    relative (p, c): how pairs depend on the patches (`Pairs.relative`), None where each patch has one, in their order
    frames (p, 3, 3), and in these gaps (p, 3) mm: normal gap and slip
    push (p, 3) N: a guess in the scene; `forces` where relative is None
    mobility (3 p, 3 p) mm/N: by how much the pairs yield beside the patches, as the bodies move that they are on
    begin: of the step, where friction is followed along it (`cfem.contact.law.sliding`)"""
    if not len(frames):
        nothing = np.zeros((0, 3))
        return Balance((), nothing, nothing, 0 * forces, -forces, compliance, nothing)
    guess, pair_compliance = (frames @ push[:, :, None])[..., 0], compliance
    if relative is not None:
        B = np.kron(relative, np.eye(3))
        by_patches = B @ compliance
        pair_compliance = by_patches @ B.T
        unguessed = by_patches @ (forces.ravel() - B.T @ push.ravel())  # mm, by forces that are not of the guess
        gaps = gaps - (frames @ unguessed.reshape(-1, 3, 1))[..., 0]
    if mobility is not None:
        pair_compliance = pair_compliance + mobility
    answer = pressed(pair_compliance, gaps, frames, guess, mu, begin)
    if answer is None:
        return None
    modes, local, slip = answer
    pushes = (local[:, None] @ frames)[:, 0]
    balanced = pushes if relative is None else relative.T @ pushes
    slid_in_scene = (slip[:, None] @ frames[:, 1:])[:, 0]
    return Balance(modes, local, pushes, balanced, balanced - forces, compliance, slid_in_scene)
