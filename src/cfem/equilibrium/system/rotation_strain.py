"""Positions of a body from rotations and stretches at its quadrature points, in which large motions are nearly linear.

A tangent of the positions stretches what turns; a tangent of F = R U, taken as a rotation vector and a change of the
stretch U, does not. States are combined in these coordinates, and positions follow by least squares,

    min sum w |grad x - F|^2,        held nodes at rest

(rotation-strain coordinates: Huang, Tong, Zhou, Bao and Desbrun, IEEE TVCG 17, 2011; modal warping: Choi and Ko, IEEE
TVCG 11, 2005). With W = R^T dF, dR = R [omega] and (tr U 1 - U) omega = axial(W - W^T)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from cfem.mechanics.body import Body
from cfem.mechanics.material.tensor import add_identity, inverse, rotation

# Angle (rad) between two states at one point up to which their rotation vectors are combined: at pi they jump.
FARTHEST = 2.5


@dataclass(frozen=True)
class RotationStrain:
    """Rotation-strain coordinates of a body.

    rest: (n, 3) mm
    held: (n,) bool, nodes that stay at rest
    gradient: (3 p, n) 1/mm: x -> transposed displacement gradients at the p quadrature points
    weights: (3 p,) mm^3
    spread: right-hand sides (free, 3) -> positions (free, 3) mm of the free nodes"""

    rest: np.ndarray
    held: np.ndarray
    gradient: sp.csr_array
    weights: np.ndarray
    spread: Callable[[np.ndarray], np.ndarray]

    def combined(self, x: np.ndarray, motions: np.ndarray, weights: np.ndarray) -> np.ndarray | None:
        """Positions (n, 3) mm where the rotation vectors, relative to the first state, and the stretches are the
        weighted sums of those of states, and of their changes with motions.

        x, motions: (k, n, 3) mm
        weights: (k,) of the states, which sum to 1
        Returns None where a state is turned too far from the first, or is not finite."""
        points = len(self.weights) // 3
        first, turn, stretch = np.empty((points, 3, 3)), np.zeros((points, 3)), np.zeros((points, 3, 3))
        _rotations(self._gradients(x[0]), first)
        for place, motion, weight in zip(x, motions, weights, strict=True):
            both = (self.gradient @ np.hstack([place - self.rest, motion])).reshape(points, 3, 6)
            D, dD = both[:, :, :3].swapaxes(1, 2), both[:, :, 3:].swapaxes(1, 2)
            if not _add_state(D, dD, first, weight, turn, stretch) < FARTHEST:
                return None
        return self._positions(_deformed(first, turn, stretch))

    def _gradients(self, x: np.ndarray) -> np.ndarray:
        """Displacement gradients D = F - 1 (p, 3, 3) at positions x (n, 3) mm."""
        return (self.gradient @ (x - self.rest)).reshape(-1, 3, 3).swapaxes(1, 2)

    def _positions(self, D: np.ndarray) -> np.ndarray:
        """Positions (n, 3) mm of least squares whose displacement gradients are D (p, 3, 3)."""
        free = ~self.held
        x = self.rest.copy()
        sides = self.gradient.T @ (self.weights[:, None] * D.swapaxes(1, 2).reshape(-1, 3))
        x[free] += self.spread(sides[free])
        return x


def make_rotation_strain(body: Body, fixed: np.ndarray) -> RotationStrain | None:
    """Rotation-strain coordinates of a body whose nodes `fixed` are held; None where it is not of solids alone, or a
    piece of it is not held."""
    n = len(body.mesh.X)
    held = np.zeros(n, dtype=bool)
    held[fixed] = True
    if body.sections is not None or not body.solids or held.all():
        return None
    gradient = sp.vstack([_gradient(part.gradients, part.cells, n) for part in body.solids], format="csr")
    weights = np.repeat(np.concatenate([part.weights.ravel() for part in body.solids]), 3)
    normal = (gradient.T @ sp.diags_array(weights) @ gradient).tocsc()
    pieces, piece = connected_components(normal, directed=False)
    if len(np.unique(piece[held])) < pieces:
        return None
    symmetric = {"SymmetricMode": True}
    factor = splu(normal[~held][:, ~held], permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)
    return RotationStrain(body.mesh.X, held, gradient, weights, factor.solve)


def _gradient(gradients: np.ndarray, cells: np.ndarray, n: int) -> sp.csr_array:
    """Matrix (3 m q, n) 1/mm of gradients (m, q, k, 3) of the shape functions of cells (m, n_nodes), bubbles left
    out."""
    m, q = gradients.shape[:2]
    k = cells.shape[1]
    columns = np.broadcast_to(cells[:, None, None, :], (m, q, 3, k))
    pointers = k * np.arange(3 * m * q + 1)
    values = gradients[:, :, :k].swapaxes(2, 3)
    return sp.csr_array((values.ravel(), columns.ravel(), pointers), shape=(3 * m * q, n))


@njit(cache=True)
def _rotations(D, R):
    """Writes the rotations (p, 3, 3) of 1 + D (p, 3, 3)."""
    for k in range(len(D)):
        rotation(D[k], R[k])


@njit(cache=True)
def _add_state(D, dD, first, weight, turn, stretch):
    """Adds to turn (p, 3) and stretch (p, 3, 3) those of a state with gradients D (p, 3, 3), times its weight, and what
    the change dD (p, 3, 3) makes of them; returns the largest angle (rad) to the rotations `first`, inf where a stretch
    has no two positive values, NaN where it is not finite."""
    F, R, U, W = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    G, G_inverse, Q = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    spin, v = np.empty(3), np.empty(3)
    largest = 0.0
    for k in range(len(D)):
        rotation(D[k], R)
        add_identity(D[k], F)
        _transposed_product(R, F, U)
        _transposed_product(R, dD[k], W)
        _transposed_product(first[k], R, Q)
        trace = U[0, 0] + U[1, 1] + U[2, 2]
        for i in range(3):
            for j in range(3):
                G[i, j] = (trace if i == j else 0.0) - U[i, j]
        if not inverse(G, G_inverse) > 0.0:
            return np.inf
        for i in range(3):
            spin[i] = 0.0
            for j in range(3):
                a, b = (j + 1) % 3, (j + 2) % 3
                spin[i] += G_inverse[i, j] * (W[b, a] - W[a, b])
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            v[i] = 0.5 * (Q[b, a] - Q[a, b])
        sine = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
        angle = np.arctan2(sine, 0.5 * (Q[0, 0] + Q[1, 1] + Q[2, 2] - 1.0))
        largest = max(largest, angle)
        scale = angle / sine if sine > 1e-9 else 1.0
        # inverse of the right Jacobian of the exponential map: w + v x w / 2 + c v x (v x w)
        c = 1.0 / 12.0 if angle < 1e-3 else 1.0 / angle**2 - (1.0 + np.cos(angle)) / (2.0 * angle * sine)
        for i in range(3):
            v[i] *= scale
        along, square = v[0] * spin[0] + v[1] * spin[1] + v[2] * spin[2], v[0] ** 2 + v[1] ** 2 + v[2] ** 2
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            across = v[a] * spin[b] - v[b] * spin[a]
            turn[k, i] += weight * v[i] + spin[i] + 0.5 * across + c * (v[i] * along - spin[i] * square)
            for j in range(3):
                # U grows by W - [spin] U
                grown = W[i, j] - (spin[a] * U[b, j] - spin[b] * U[a, j])
                stretch[k, i, j] += weight * U[i, j] + grown
    return largest


@njit(cache=True)
def _deformed(first, turn, stretch):
    """Displacement gradients (p, 3, 3) of rotations `first` turned further by `turn` (p, 3), and of stretches."""
    D, T, Q = np.empty(first.shape), np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(first)):
        v = turn[k]
        square = v[0] ** 2 + v[1] ** 2 + v[2] ** 2
        angle = np.sqrt(square)
        s = np.sin(angle) / angle if angle > 1e-6 else 1.0
        c = (1.0 - np.cos(angle)) / square if angle > 1e-6 else 0.5
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            Q[i, i] = 1.0 - c * (square - v[i] ** 2)
            Q[a, b] = c * v[a] * v[b] - s * v[i]
            Q[b, a] = c * v[a] * v[b] + s * v[i]
        for i in range(3):
            for j in range(3):
                T[i, j] = Q[i, 0] * stretch[k, 0, j] + Q[i, 1] * stretch[k, 1, j] + Q[i, 2] * stretch[k, 2, j]
        for i in range(3):
            for j in range(3):
                R = first[k]
                D[k, i, j] = R[i, 0] * T[0, j] + R[i, 1] * T[1, j] + R[i, 2] * T[2, j] - (1.0 if i == j else 0.0)
    return D


@njit(cache=True)
def _transposed_product(A, B, out):
    """Writes A^T B."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]
