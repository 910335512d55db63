"""Inner motions of sampled states: what moves while the actuators stand still, chosen alike at all states.

Of a robot of sections in a row the samples have them. Of others they are chosen here from the motions (Z, Y) of the
rows (cfem.equilibrium.motion.inertia): those that answer the inertia of the actuators' motions, and forces and inertia
at the effectors, with the actuators held, filtered once more by A^-1 M, so that the lowest vibrations prevail. At each
state they are made orthonormal in the stiffness, by the nearest such basis to constant combinations of them (Loewdin,
J. Chem. Phys. 18, 1950): a smooth choice, as vibrations themselves are not, whose frequencies cross. The combinations
are those that are nearest to orthonormal over all states, the strongest first.

Where the samples know D, how the effectors' compliance C changes with a wrench on them, the effectors' paths curve with
the inner motions: each is, as far as mass tells, what a wrench w makes with the actuators held, and the effectors move
by D[w, w] / 2 to second order (a quadratic manifold of static modal derivatives: Jain, Tiso, Rutzmoser and Rixen,
Comput. Struct. 188, 2017). What of that lies where C is soft is left out: it belongs to the amplitudes of the same
motions, which are taken to vibrate linearly. What stays is the sag of an arc, where C is stiff."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed.condensed import locked_compliance

MOST = 6  # inner motions of a solid
WEAK = 1e-5  # least singular value of the combinations, at all states
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


def inner_motions(moving: Any, D: np.ndarray | None = None) -> InnerMotions:
    """Inner motions at the states of a dataset whose robot moves; D (m, n_e, n_e, n_e) mm/N^2 of the plain rows."""
    if moving.inner_M is None:
        return _of_rows(moving, D)
    n_a = moving.rows.n_a
    values, vectors = np.linalg.eigh(moving.inner_K)
    root = (vectors / np.sqrt(values)[:, None]) @ vectors.swapaxes(1, 2)
    T = np.zeros_like(moving.inner_M)
    T[:, :n_a, :n_a], T[:, n_a:, n_a:] = np.eye(n_a), root
    return InnerMotions(T @ moving.inner_M @ T, T[:, None] @ moving.inner_loss @ T[:, None], moving.inner_e @ root)


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


def _of_rows(moving: Any, D: np.ndarray | None) -> InnerMotions:
    """Inner motions from vibrations of the rows' motions with the actuators held, the same combination of wrenches at
    all states. D: dC/dw, for the curve."""
    states = [_state(moving, index) for index in range(len(moving.W))]
    n_a = moving.rows.n_a
    p = min(len(state.squares) for state in states)
    squares = np.array([state.squares[:p] for state in states])
    fields = np.array([state.fields[:p] for state in states])
    of_wrenches = fields[:, :, n_a : n_a + moving.rows.n_e]
    # in units of the stiffness, filtered by A^-1 M
    fields = fields * (squares.mean(axis=0)[0] / np.sqrt(squares))[:, :, None]
    Q = _alike(fields) / np.sqrt(squares)[:, :, None]
    T = np.zeros((len(states), n_a + p, n_a + Q.shape[2]))
    T[:, :n_a, :n_a], T[:, n_a:, n_a:] = np.eye(n_a), Q
    columns = slice(0, n_a + p)
    M = T.swapaxes(1, 2) @ np.array([state.M[columns, columns] for state in states]) @ T
    loss = T.swapaxes(1, 2)[:, None] @ np.array([state.loss[:, columns, columns] for state in states]) @ T[:, None]
    curve = None
    if D is not None:
        w = _wrenches(of_wrenches, Q)
        curve = np.einsum("mie,mejk,mjl,mkn->miln", _stiff(moving), D, w, w, optimize=True)
    e, skin = (np.array([getattr(state, name)[:, :p] for state in states]) @ Q for name in ("e", "skin"))
    return InnerMotions(M, loss, e, curve, skin if skin.shape[1] else None)


def _state(moving: Any, index: int) -> _State:
    """Vibrations of one state: the motions (Z, Y) of its rows, made to leave the actuators alone, independent in K and
    M."""
    rows, n = moving.rows, moving.rows.n
    W, V, V2, V3 = (getattr(moving, name)[index] for name in ("W", "V", "V2", "V3"))
    a, e = np.arange(n)[rows.a], np.arange(n)[rows.e]
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
    fields = np.hstack([amplitudes[:, n + a] @ K_aa, amplitudes[:, e], amplitudes[:, n + e]])
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


def _alike(fields: np.ndarray) -> np.ndarray:
    """Orthonormal directions (m, p, k) at each state, from fields (m, p, f) there: k is as large as all states
    allow."""
    fields = fields / np.sqrt((fields**2).sum(axis=1).mean(axis=0))
    gram = (fields.swapaxes(1, 2) @ fields).mean(axis=0)
    values, vectors = np.linalg.eigh(gram)
    ridge = RIDGE * np.eye(len(gram))
    for k in range(min(MOST, *fields.shape[1:]), 0, -1):
        combined = vectors[:, ::-1][:, :k] / np.sqrt(np.maximum(values[::-1][:k], 1e-300))
        for _ in range(ROUNDS):
            nearest, least = _orthonormal(fields @ combined)
            combined = np.linalg.solve(gram + ridge, (fields.swapaxes(1, 2) @ nearest).mean(axis=0))
        nearest, least = _orthonormal(fields @ combined)
        if least > WEAK or k == 1:
            return nearest
    raise AssertionError("no field")


def _orthonormal(P: np.ndarray) -> tuple[np.ndarray, float]:
    """The nearest orthonormal columns to those of P (m, p, k), and its least singular value over the largest."""
    U, s, Vt = np.linalg.svd(P, full_matrices=False)
    return U @ Vt, float((s[:, -1] / s[:, 0]).min())
