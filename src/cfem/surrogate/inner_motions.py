"""Inner motions of sampled states: what moves while the actuators stand still, chosen alike at all states.

Of a robot of sections in a row the samples have them. Of others they are taken from the motions (Z, Y) of the rows
(cfem.equilibrium.motion.inertia) with the actuators held, in two steps:

1. The space of the k lowest vibrations. These change places where their frequencies cross; their space is a smooth
   function of the state as long as the next vibration stays above.
2. Of what is left of the fields that answer the inertia of the actuators' motions, and forces and inertia at effectors
   and skin, filtered once by A^-1 M, the strongest.

In each the basis is the nearest orthonormal one, in the stiffness, to constant combinations of the fields, which are
smooth (Loewdin, J. Chem. Phys. 18, 1950). In the first step each vibration counts alike in the fields: the third one of
a straight finger, a torsion, is a hundredth of what any force on its tip makes.

Where the samples know D, how the effectors' compliance C changes with a wrench on them, the effectors' paths curve with
the inner motions: each is, as far as mass tells, what a wrench w makes with the actuators held, and the effectors move
by D[w, w] / 2 to second order (a quadratic manifold of static modal derivatives: Jain, Tiso, Rutzmoser and Rixen,
Comput. Struct. 188, 2017). What of that lies where C is soft is left out: it belongs to the amplitudes of the same
motions, which are taken to vibrate linearly. What stays is the sag of an arc, where C is stiff."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed.condensed import locked_compliance

MOST, FEWEST = 6, 3  # inner motions of a solid, and vibrations among them
CLEAR = 0.03  # least singular value of the combinations over the largest, at all states, below which they are not clear
RIDGE = 0.1  # of a field's mean square: how much weaker fields follow the stronger ones
ROUNDS = 100
STIFF = 0.01  # of the largest mass of a wrench's motion, and of the largest square of C, below which others are stiff
INDEPENDENT = 1e-9  # of the largest eigenvalue of the scaled stiffness of (Z, Y)


@dataclass(frozen=True)
class InnerMotions:
    """k inner motions at m states, of stiffness 1 N mm each, independent of each other in it; n = n_a + k.

    M: (m, n, n) mass of the actuators' quasi-static motions and these
    loss: (m, j, n, n) of each material
    e: (m, n_e, k) mm
    curve: (m, n_e, k, k) mm, second derivative of the effectors' places by the amplitudes; None where not known
    skin: (m, n_s, k) mm, motion of the rows of the skin; None where not known"""

    M: np.ndarray
    loss: np.ndarray
    e: np.ndarray
    curve: np.ndarray | None = None
    skin: np.ndarray | None = None


def inner_motions(moving: Any, D: np.ndarray | None = None) -> Iterator[InnerMotions]:
    """Inner motions at the states of a dataset whose robot moves, where there is a choice with several numbers of
    vibrations: the most first. D (m, n_e, n_e, n_e) mm/N^2 of the plain rows."""
    if moving.inner_M is None:
        yield from _of_rows(moving, D)
        return
    n_a = moving.rows.n_a
    values, vectors = np.linalg.eigh(moving.inner_K)
    root = (vectors / np.sqrt(values)[:, None]) @ vectors.swapaxes(1, 2)
    T = np.zeros_like(moving.inner_M)
    T[:, :n_a, :n_a], T[:, n_a:, n_a:] = np.eye(n_a), root
    yield InnerMotions(T @ moving.inner_M @ T, T[:, None] @ moving.inner_loss @ T[:, None], moving.inner_e @ root)


@dataclass(frozen=True)
class _State:
    """One state, in p vibrations of the rows' motions with the actuators held, of unit mass.

    squares: (p,) 1/s^2
    fields: (p, f) of all that may be chosen from
    M, loss, e, skin: as in `InnerMotions`, with all p"""

    squares: np.ndarray
    fields: np.ndarray
    M: np.ndarray
    loss: np.ndarray
    e: np.ndarray
    skin: np.ndarray


def _of_rows(moving: Any, D: np.ndarray | None) -> Iterator[InnerMotions]:
    """Inner motions of a solid. D: dC/dw, for the curve."""
    states = [_state(moving, index) for index in range(len(moving.W))]
    p = min(len(state.squares) for state in states)
    squares, fields = (
        np.array([state.squares[:p] for state in states]),
        np.array([state.fields[:p] for state in states]),
    )
    fields = fields / _size(fields, (0, 1))
    offered = False
    for k in range(min(MOST, *fields.shape[1:]), 0, -1):
        lowest = fields[:, :k]
        vibrations, least = _common_directions(lowest / _size(lowest, (0, 2)), k)
        clear, wanted = least > CLEAR or k == 1, k >= FEWEST or not offered
        if clear and wanted:
            offered, Q = True, np.zeros((len(states), p, MOST))
            others = _clearest(fields[:, k:] / np.sqrt(squares[:, k:, None]), MOST - k)
            n = k + others.shape[2]
            Q[:, :k, :k], Q[:, k:, k:n] = vibrations, others
            yield _combined(moving, states, Q[:, :, :n] / np.sqrt(squares)[:, :, None], D)


def _combined(moving: Any, states: list[_State], Q: np.ndarray, D: np.ndarray | None) -> InnerMotions:
    """Inner motions Q (m, p, k) of each state's vibrations."""
    n_a, (p, k) = moving.rows.n_a, Q.shape[1:]
    T = np.zeros((len(states), n_a + p, n_a + k))
    T[:, :n_a, :n_a], T[:, n_a:, n_a:] = np.eye(n_a), Q
    columns = slice(0, n_a + p)
    M = T.swapaxes(1, 2) @ np.array([state.M[columns, columns] for state in states]) @ T
    loss = T.swapaxes(1, 2)[:, None] @ np.array([state.loss[:, columns, columns] for state in states]) @ T[:, None]
    curve = None
    if D is not None:
        w = _wrenches(np.array([state.fields[:p, n_a : n_a + moving.rows.n_e] for state in states]), Q)
        curve = np.einsum("mie,mejk,mjl,mkn->miln", _stiff(moving), D, w, w, optimize=True)
    e, skin = (np.array([getattr(state, name)[:, :p] for state in states]) @ Q for name in ("e", "skin"))
    return InnerMotions(M, loss, e, curve, skin if skin.shape[1] else None)


def _state(moving: Any, index: int) -> _State:
    """Vibrations of one state: the motions (Z, Y) of its rows, made to leave the actuators alone, independent in K and
    M."""
    rows, n = moving.rows, moving.rows.n
    W, V, V2, V3 = (getattr(moving, name)[index] for name in ("W", "V", "V2", "V3"))
    a, e, skin = np.arange(n)[rows.a], np.arange(n)[rows.e], np.arange(n)[rows.s]
    K, M, by_rows = np.block([[W, V], [V, V2]]), np.block([[V, V2], [V2, V3]]), np.hstack([W, V])
    size = 1 / np.sqrt(np.diag(K))
    K, M, F, by_rows = K * np.outer(size, size), M * np.outer(size, size), moving.loss[index], by_rows * size
    F = F * np.outer(size, size)
    K_aa = np.linalg.inv(W[np.ix_(a, a)])
    X = np.zeros((2 * n, len(a)))
    X[a] = K_aa
    X /= size[:, None]
    locked = np.linalg.svd(by_rows[a] / np.linalg.norm(by_rows[a], axis=1)[:, None])[2][len(a) :].T
    values, vectors = np.linalg.eigh(locked.T @ K @ locked)
    kept = values > INDEPENDENT * values[-1]
    basis = locked @ (vectors[:, kept] / np.sqrt(values[kept]))
    inverse, shapes = np.linalg.eigh(basis.T @ M @ basis)
    inverse, shapes = inverse[::-1], basis @ shapes[:, ::-1]
    positive = inverse > 1e-12 * inverse[0]
    inverse, shapes = inverse[positive], shapes[:, positive] / np.sqrt(inverse[positive])
    amplitudes = (shapes.T @ K / size) * inverse[:, None]  # of (Z, Y), the actuators held
    fields = np.hstack([amplitudes[:, n + a] @ K_aa, amplitudes[:, e], amplitudes[:, n + e], amplitudes[:, skin]])
    motions = np.hstack([X, shapes])
    return _State(
        1 / inverse,
        fields,
        motions.T @ M @ motions,
        motions.T @ F @ motions,
        by_rows[e] @ shapes,
        by_rows[rows.s] @ shapes,
    )


def _wrenches(fields: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Forces (m, n_e, k) N whose motions `fields` (m, p, n_e) are near Q (m, p, k) in the mass, with little of those
    that hardly move anything: of a stiff direction, what is not such a motion would make much."""
    size = np.linalg.norm(fields, axis=1)[:, None]
    unit = fields / np.maximum(size, np.finfo(float).tiny)
    gram = unit.swapaxes(1, 2) @ unit
    largest = np.linalg.eigvalsh(gram)[:, -1, None, None]
    shares = np.linalg.solve(gram + STIFF * largest * np.eye(gram.shape[1]), unit.swapaxes(1, 2) @ Q)
    return shares / np.maximum(size, np.finfo(float).tiny).swapaxes(1, 2)


def _stiff(moving: Any) -> np.ndarray:
    """Projection (m, n_e, n_e) that takes from the effectors' motions those that C makes easily. Rows of a point, and
    of a rotation, are compared as they are."""
    C = locked_compliance(moving.rows, moving.W)
    size = np.sqrt(np.einsum("mii->mi", C).mean(axis=0).reshape(-1, 3).mean(axis=1).repeat(3))
    values, vectors = np.linalg.eigh(C / np.outer(size, size))
    kept = STIFF / ((values / values[:, -1:]) ** 2 + STIFF)
    return size[:, None] * ((vectors * kept[:, None]) @ vectors.swapaxes(1, 2)) / size


def _size(fields: np.ndarray, axes: tuple[int, ...]) -> np.ndarray:
    """Root of the mean square over these axes, to divide by."""
    return np.sqrt(np.maximum((fields**2).mean(axis=axes, keepdims=True), np.finfo(float).tiny))


def _clearest(fields: np.ndarray, most: int) -> np.ndarray:
    """Orthonormal directions (m, p, k <= most) near constant combinations of fields (m, p, f): as many as these make
    clearly at all states, each field counting alike."""
    for k in range(min(most, *fields.shape[1:]), 0, -1):
        directions, least = _common_directions(fields / _size(fields, (0, 1)), k)
        if least > CLEAR:
            return directions
    return np.zeros((*fields.shape[:2], 0))


def _common_directions(fields: np.ndarray, k: int) -> tuple[np.ndarray, float]:
    """Orthonormal directions (m, p, k) at each state near constant combinations of fields (m, p, f), the strongest; and
    the least singular value of these over the largest of its state."""
    gram = (fields.swapaxes(1, 2) @ fields).mean(axis=0)
    values, vectors = np.linalg.eigh(gram)
    ridge = RIDGE * np.eye(len(gram))
    combined = vectors[:, ::-1][:, :k] / np.sqrt(np.maximum(values[::-1][:k], 1e-300))
    for _ in range(ROUNDS):
        nearest, _ = _orthonormal(fields @ combined)
        combined = np.linalg.solve(gram + ridge, (fields.swapaxes(1, 2) @ nearest).mean(axis=0))
    return _orthonormal(fields @ combined)


def _orthonormal(P: np.ndarray) -> tuple[np.ndarray, float]:
    """The nearest orthonormal columns to those of P (m, p, k), and its least singular value over the largest."""
    U, s, Vt = np.linalg.svd(P, full_matrices=False)
    return U @ Vt, float((s[:, -1] / s[:, 0]).min())
