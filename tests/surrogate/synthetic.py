"""A robot with a closed-form energy: every identity between Psi, e, C_ee and (W, delta_free) holds exactly.

In q = Q delta_a (mean shortening q_0, contrasts q_i) Psi = A (cosh(a q_0) - 1) + sum_i B q_i^2 / (1 + b q_0) + G q_i^4:
strictly convex on the states sampled here. The tip bends by an angle k q_0 and leans by q_1."""

from types import SimpleNamespace

import numpy as np

from cfem.condensed import Rows, unpack_upper

A, a, B, b, G, K, LENGTH, REACH = 380.0, 0.055, 4.3, 0.02, 0.01, 0.04, 110.0, 20.0


def coordinates(n_a: int) -> np.ndarray:
    """(n_a, n_a) rows: the mean, then n_a - 1 orthogonal contrasts of the same size."""
    basis = np.linalg.qr(np.column_stack([np.ones(n_a), np.eye(n_a)[:, : n_a - 1]]))[0].T
    return np.sign(basis[0, 0]) * basis / np.sqrt(n_a)


def bend_and_lean(Q: np.ndarray, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(2, n_a) the rows of Q that move the tip (one cable cannot lean: its row is zero), and q_0, q_1 (m,)."""
    Q = np.vstack([Q, np.zeros_like(Q)])[[0, 1]] if len(Q) == 1 else Q[:2]
    return Q, *(delta_a @ Q.T).T


def energy(delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(m, n_a) mm -> Psi (m,), gradient (m, n_a), Hessian (m, n_a, n_a)."""
    Q = coordinates(delta_a.shape[1])
    q = delta_a @ Q.T
    s, d = q[:, 0], q[:, 1:]
    soft = 1 / (1 + b * s)
    value = A * (np.cosh(a * s) - 1) + (B * d**2 * soft[:, None] + G * d**4).sum(axis=1)
    gradient, hessian = np.zeros_like(q), np.zeros((*q.shape, q.shape[1]))
    gradient[:, 0] = A * a * np.sinh(a * s) - B * b * (d**2).sum(axis=1) * soft**2
    gradient[:, 1:] = 2 * B * d * soft[:, None] + 4 * G * d**3
    hessian[:, 0, 0] = A * a**2 * np.cosh(a * s) + 2 * B * b**2 * (d**2).sum(axis=1) * soft**3
    hessian[:, 0, 1:] = hessian[:, 1:, 0] = -2 * B * b * d * soft[:, None] ** 2
    for i in range(1, q.shape[1]):
        hessian[:, i, i] = 2 * B * soft + 12 * G * d[:, i - 1] ** 2
    return value, gradient @ Q, Q.T @ hessian @ Q


def effector(delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """-> e (m, 3) mm and its gradient (m, 3, n_a)."""
    Q, s, d = bend_and_lean(coordinates(delta_a.shape[1]), delta_a)
    sin, cos = np.sin(K * s), np.cos(K * s)
    e = np.column_stack([4 * d * cos, LENGTH * sin * (1 - 1e-3 * d**2), LENGTH * (1 - cos)])
    gradient = np.zeros((len(s), 3, 2))
    gradient[:, 0, 0], gradient[:, 0, 1] = -4 * K * d * sin, 4 * cos
    gradient[:, 1, 0], gradient[:, 1, 1] = LENGTH * K * cos * (1 - 1e-3 * d**2), -2e-3 * LENGTH * sin * d
    gradient[:, 2, 0] = LENGTH * K * sin
    return e, gradient @ Q


def locked_compliance(delta_a: np.ndarray) -> np.ndarray:
    """-> C_ee (m, 3, 3) mm/N, positive definite."""
    _, s, d = bend_and_lean(coordinates(delta_a.shape[1]), delta_a)
    entries = [
        20 / (1 + 0.02 * s),
        0.1 * d,
        0.02 * d,
        3 + 0.5 * np.cos(0.1 * s),
        0.3 * np.sin(0.1 * s),
        0.3 + 0.01 * s,
    ]
    return unpack_upper(np.column_stack(entries))


def dataset(m: int, seed: int, n_a: int = 2, unilateral: bool = True) -> SimpleNamespace:
    """m random states of [0, 20 mm]^n_a, with unilateral=True those which need no pushing cable."""
    delta_a = np.random.default_rng(seed).uniform(0, REACH, (200 * m if unilateral else m, n_a))
    if unilateral:
        delta_a = delta_a[(energy(delta_a)[1] >= 0).all(axis=1)][:m]
        assert len(delta_a) == m
    psi, lam, hessian = energy(delta_a)
    e, gradient = effector(delta_a)
    rows = Rows(("tip.x", "tip.y", "tip.z"), tuple(f"cable{i}" for i in range(n_a)))
    W = np.empty((m, rows.n, rows.n))
    W[:, rows.a, rows.a] = W_aa = np.linalg.inv(hessian)
    W[:, rows.e, rows.a] = gradient @ W_aa
    W[:, rows.a, rows.e] = W[:, rows.e, rows.a].swapaxes(1, 2)
    W[:, rows.e, rows.e] = locked_compliance(delta_a) + gradient @ W_aa @ gradient.swapaxes(1, 2)
    delta_free = np.hstack([e, delta_a]) - np.einsum("mij,mj->mi", W[:, :, rows.a], lam)
    meta = {
        "scene": "synthetic",
        "rest_e": [0.0, 10.0, -LENGTH],
        "reach": [[0.0, REACH]] * n_a,
        "length": LENGTH,
        "units": {"delta_a": "mm", "lambda_a": "N", "W": "mm/N", "delta_free": "mm"},
    }
    arrays = dict(delta_a=delta_a, delta_e=e, lambda_a=lam, W=W, delta_free=delta_free, energy=psi)
    return SimpleNamespace(rows=rows, meta=meta, **arrays)
