"""A robot with a closed-form energy: every identity between Psi, e, C_ee and (W, delta_free) holds exactly.

In q = Q delta_a (mean shortening q_0, contrasts q_i) Psi = A (cosh(a q_0) - 1) + sum_i B q_i^2 / (1 + b q_0) + G q_i^4:
strictly convex on the states sampled here. The tip bends by an angle k q_0 and leans by q_1."""

from dataclasses import replace

import numpy as np
import pyarrow as pa

from cfem.condensed import Rows, unpack_upper
from cfem.condensed.parameters import Parameter, to_json
from cfem.dataset.reader import Dataset

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


POISSON = Parameter("poisson", "material.poisson", "1", 0.3, 0.49, 0.4, "log(1-2p)")
YOUNG = Parameter("young", "material.young", "MPa", 1.0, 9.0, 3.0, "log", exact=True)


def stiffer(p: np.ndarray) -> np.ndarray:
    """(m, 1) Poisson's ratio -> (m,) factor of the energy, 1 at p = 0."""
    return 1 + 0.1 * np.log(1 - 2 * p[:, 0]) ** 2


def states(delta_a: np.ndarray, factor: np.ndarray) -> dict[str, np.ndarray]:
    """All columns of states (m, n_a) of robots whose energy is `factor` (m,) times that above."""
    psi, lam, hessian = energy(delta_a)
    psi, lam, hessian = factor * psi, factor[:, None] * lam, factor[:, None, None] * hessian
    e, gradient = effector(delta_a)
    rows = rows_of(delta_a.shape[1])
    W = np.empty((len(delta_a), rows.n, rows.n))
    W[:, rows.a, rows.a] = W_aa = np.linalg.inv(hessian)
    W[:, rows.e, rows.a] = gradient @ W_aa
    W[:, rows.a, rows.e] = W[:, rows.e, rows.a].swapaxes(1, 2)
    C = locked_compliance(delta_a) / factor[:, None, None]
    W[:, rows.e, rows.e] = C + gradient @ W_aa @ gradient.swapaxes(1, 2)
    delta_free = np.hstack([e, delta_a]) - np.einsum("mij,mj->mi", W[:, :, rows.a], lam)
    return dict(delta_a=delta_a, delta_e=e, lambda_a=lam, W=W, delta_free=delta_free, energy=psi)


def compliance_derivatives(delta_a: np.ndarray, factor: np.ndarray, h: float = 1e-3) -> np.ndarray:
    """(m, n_a, n, n) dW/dlambda_k = sum_l W_kl dW/ddelta_l, by central differences of fourth order."""

    def W(steps: float, axis: int) -> np.ndarray:
        return states(delta_a + steps * h * np.eye(delta_a.shape[1])[axis], factor)["W"]

    by_delta = np.stack(
        [(8 * (W(1, i) - W(-1, i)) - (W(2, i) - W(-2, i))) / (12 * h) for i in range(delta_a.shape[1])], axis=1
    )
    a = rows_of(delta_a.shape[1]).a
    return np.einsum("mkl,mlij->mkij", states(delta_a, factor)["W"][:, a, a], by_delta)


def rows_of(n_a: int) -> Rows:
    return Rows(("tip.x", "tip.y", "tip.z"), tuple(f"cable{i}" for i in range(n_a)))


def dataset(
    m: int, seed: int, n_a: int = 2, unilateral: bool = True, third_order: bool = False, parameters: bool = False
) -> Dataset:
    """m random states of [0, 20 mm]^n_a, with unilateral=True those which need no pushing cable; parameters: of robots
    with random Poisson's ratios."""
    rng = np.random.default_rng(seed)
    delta_a = rng.uniform(0, REACH, (200 * m if unilateral else m, n_a))
    if unilateral:
        delta_a = delta_a[(energy(delta_a)[1] >= 0).all(axis=1)][:m]
        assert len(delta_a) == m
    q = rng.uniform(np.log(1 - 2 * POISSON.high), np.log(1 - 2 * POISSON.low), (m, 1))
    p = (1 - np.exp(q)) / 2 if parameters else np.zeros((m, 0))
    factor = stiffer(p) if parameters else np.ones(m)
    meta = {
        "scene": "synthetic",
        "rest_e": [0.0, 10.0, -LENGTH],
        "reach": [[0.0, REACH]] * n_a,
        "length": LENGTH,
        "row_units": [("mm", "N")] * (3 + n_a),
        "units": {"delta_a": "mm", "lambda_a": "N", "delta_e": "mm", "W": "mm/N", "delta_free": "mm", "energy": "N mm"},
        "parameters": to_json([POISSON, YOUNG]) if parameters else [],
    }
    names = ("iterations", "factorizations", "steps", "residual", "seconds")
    slope = 0.2 * np.log1p(-2 * p) * -2 / (1 - 2 * p)
    return Dataset(
        rows=rows_of(n_a),
        id=np.arange(m),
        u=np.hstack([delta_a / REACH, p]),
        slack=np.zeros((m, n_a), dtype=bool),
        p=p,
        dW=compliance_derivatives(delta_a, factor) if third_order else None,
        dC=None,
        d2C=None,
        dpsi_dp=slope * energy(delta_a)[0][:, None] if parameters else None,
        dlambda_dp=slope[:, None] * energy(delta_a)[1][..., None] if parameters else None,
        ddelta_e_dp=np.zeros((m, 3, 1)) if parameters else None,
        cost={name: np.full(m, 0.1) for name in names},
        failed=pa.table({}),
        meta=meta,
        **states(delta_a, factor),
    )


def at_rest(given: Dataset) -> Dataset:
    """The same robots, actuators free: displacements and delta_free are what finite elements round."""
    free = states(np.zeros_like(given.delta_a), stiffer(given.p) if given.p.size else np.ones(len(given)))
    rng = np.random.default_rng(0)
    rounding = {name: 1e-13 * rng.normal(size=free[name].shape) for name in ("delta_a", "delta_free")}
    return replace(given, **free | rounding)
