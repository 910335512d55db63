"""The whole surface of a robot from a model: modes of its displacement, and how far each goes.

Every mode is a row of W, as an effector is: its displacement s is a Chebyshev series of the model's inputs, beside it a
series of the compliances C_es and C_ss that are left with the actuators locked (form 'displacement') or their forces
held ('force'). The blocks of W follow from W_aa and W_ea of the model as those of effectors do
(`cfem.predict.series.energy`). A model of any kind has such a skin, or none; what does not ask for shapes never reads
it."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np

from cfem.condensed import Condensed
from cfem.condensed.packing import unpacking
from cfem.condensed.skin import PREFIX, Skin
from cfem.constraint.patch import PatchLoad
from cfem.core.errors import InputError, SpecError
from cfem.core.reading import take
from cfem.predict.series.chebyshev import Basis, union
from cfem.predict.series.energy import Form
from cfem.predict.series.semidefinite import with_nearest

FILE = "skin.npz"  # of a model folder
LAST = 8  # values of a basis that are kept
HELD = 1e-6  # of the largest mode: where they are smaller, the body is held


class LearnedSkin:
    """arrays: nodes (m,), rest (m, 3) mm, triangles (t, 3), weights (m,), modes (k, m, 3) as `cfem.condensed.skin`;
    to_box (n, n) and offset (n,) with z = to_box t + offset, t = (s, q) the model's inputs; indices (M, n) and series
    (k, M) of the rows; compliance_indices (L, n) and compliance (n_e k + k (k + 1) / 2, L): C_es row by row, then the
    upper triangle of C_ss.

    rest (m, 3) mm, triangles (t, 3), normals outward, and weights (m,), shares of the surface, are of the m surface
    nodes; nodes (m,): their numbers in the mesh; names (k,): of the rows."""

    def __init__(self, form: Form, n_e: int, n_a: int, n_inputs: int, arrays: dict[str, np.ndarray]):
        """Reads the arrays, and demands that their shapes fit each other."""
        self.form, self._n_e, self._n_a = form, n_e, n_a
        self.arrays = arrays
        self.rest = take(arrays, "rest", (None, 3)).astype(float)
        m = len(self.rest)
        self.nodes, self.triangles = take(arrays, "nodes", (m,), "iu"), take(arrays, "triangles", (None, 3), "iu")
        self.weights = take(arrays, "weights", (m,)).astype(float)
        modes = take(arrays, "modes", (None, m, 3)).astype(float)
        k = len(modes)
        self.names = tuple(f"{PREFIX}.{number}" for number in range(1, k + 1))
        self.modes = modes
        self._flat = modes.reshape(k, -1)
        self._to_box, self._offset = take(arrays, "to_box", (n_inputs, n_inputs)), take(arrays, "offset", (n_inputs,))
        rows = take(arrays, "indices", (None, n_inputs), "iu").astype(np.int64)
        self._soft = take(arrays, "compliance_indices", (None, n_inputs), "iu").astype(np.int64)
        indices, (first, self._of_soft) = union(rows, self._soft)
        self._basis, self._last = Basis(indices), {}
        self._series_T = np.zeros((len(indices), k))
        self._series_T[first] = take(arrays, "series", (k, len(rows))).T
        self._compliance = take(arrays, "compliance", (n_e * k + k * (k + 1) // 2, len(self._soft)))

    def __len__(self) -> int:
        return len(self.names)

    @property
    def watched(self) -> Skin:
        """Rows of the skin, for finite elements to watch."""
        return Skin(self.nodes, self.rest, self.triangles, self.weights, self.modes, np.zeros((1, 2)))

    def rows(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Rows (..., k) mm from rest at inputs s (..., n_a) and parameters q (..., n_q)."""
        return self._at(s, q) @ self._series_T

    def surface(self, rows: np.ndarray) -> np.ndarray:
        """Positions (..., m, 3) mm of the surface nodes at rows (..., k) mm."""
        return (rows @ self._flat).reshape(*rows.shape[:-1], *self.rest.shape) + self.rest

    def all_nodes(self, rows: np.ndarray) -> np.ndarray:
        """Positions (..., n, 3) mm of all nodes from rows (..., k) mm, in the order of the mesh. InputError where the
        samples had the surface alone."""
        if "inner_nodes" not in self.arrays:
            do = "sample it with `skin: {inner: true}` in sample.yaml, and train again"
            raise InputError("the skin has no nodes inside the body", do=do)
        inner = take(self.arrays, "inner_nodes", (None,), "iu")
        rest = take(self.arrays, "inner_rest", (len(inner), 3))
        modes = take(self.arrays, "inner_modes", (len(self), len(inner), 3)).astype(float)
        n = len(self.nodes) + len(inner)
        if not np.array_equal(np.sort(np.concatenate([self.nodes, inner])), np.arange(n)):
            raise InputError("array 'inner_nodes' has others than the nodes that the surface leaves")
        places = np.empty((*rows.shape[:-1], n, 3))
        places[..., self.nodes, :] = self.surface(rows)
        places[..., inner, :] = np.tensordot(rows, modes, axes=(-1, 0)) + rest
        return places

    def modes_over(self, patches: Sequence[PatchLoad]) -> np.ndarray:
        """Modes (k, 3 P) as means over patches. SpecError where a patch is not on the surface, or is held."""
        columns, largest = [], np.abs(self.modes).max()
        for patch in patches:
            shares = patch.shares(self.rest, self.triangles, self.weights)
            columns.append(np.tensordot(self.modes, shares, axes=(1, 0)))
            if np.abs(columns[-1]).max() < HELD * largest:
                what = "the body is held here, so that no force moves it"
                raise SpecError(what, where=f"loads.{patch.name}", do="take a place where it is free")
        return np.hstack(columns)

    def gradient(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Derivatives (..., k, n_a) of the rows by s."""
        slopes = self._at(s, q) @ self._slopes_T
        return slopes.reshape(*slopes.shape[:-1], len(self), s.shape[-1])

    def compliance(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """C_es (..., n_e, k) and C_ss (..., k, k), mm/N."""
        packed, k = self._at(s, q)[..., self._of_soft] @ self._compliance.T, len(self)
        across = self._n_e * k
        C_es = packed[..., :across].reshape(*packed.shape[:-1], self._n_e, k)
        return C_es, packed[..., across:][..., self._unpacking]

    def compliance_slopes(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (n_a, n_e, k) and (n_a, k, k) of `compliance` by s (n_a,)."""
        packed, k = (self._at(s, q)[self._of_soft] @ self._compliance_slopes_T).reshape(self._n_a, -1), len(self)
        across = self._n_e * k
        return packed[:, :across].reshape(-1, self._n_e, k), packed[:, across:][:, self._unpacking]

    def joined(self, condensed: Condensed, s: np.ndarray, q: np.ndarray, softer: float = 1.0) -> Condensed:
        """The condensed robot with the rows of the skin. s, q: inputs of the reference at which it is; softer: how much
        more compliant it is than that, where Young's modulus is exact."""
        old, rows = condensed.rows, replace(condensed.rows, skin=self.names)
        kept = np.r_[rows.e, rows.active]
        W = np.empty((rows.n, rows.n))
        W[np.ix_(kept, kept)] = condensed.W
        gradient, (C_es, C_ss) = self.gradient(s, q), self.compliance(s, q)
        locked = self.form == "displacement"
        W_sa = gradient @ condensed.W[old.a, old.a] if locked else softer * gradient
        W_se = softer * C_es.T + (gradient @ condensed.W[old.a, old.e] if locked else 0.0)
        W_ss = softer * C_ss + (W_sa @ gradient.T if locked else 0.0)
        W[rows.s, rows.s], W[rows.s, rows.a], W[rows.s, rows.e] = W_ss, W_sa, W_se
        W[rows.a, rows.s], W[rows.e, rows.s] = W_sa.T, W_se.T
        watched = rows.active.start
        W = with_nearest(W, watched, np.sqrt(np.abs(np.diag(W)[:watched])))  # locked, so many rows hardly comply
        free = np.empty(rows.n)
        free[kept] = condensed.delta_free
        free[rows.s] = self.rows(s, q) - W_sa @ condensed.lam
        return Condensed(rows, W, free, condensed.lam)

    @cached_property
    def _unpacking(self) -> np.ndarray:
        return unpacking(len(self))

    @cached_property
    def _slopes_T(self) -> np.ndarray:
        """Series (M, k n_a) of the gradient."""
        slopes = np.stack([D @ self._series_T for D in self._derivatives(self._basis.indices)], axis=-1)
        return slopes.reshape(len(slopes), -1)

    @cached_property
    def _compliance_slopes_T(self) -> np.ndarray:
        """Series (L, n_a (n_e k + k (k + 1) / 2)) of the compliance's derivatives."""
        return np.hstack([D @ self._compliance.T for D in self._derivatives(self._soft)])

    def _derivatives(self, indices: np.ndarray) -> list[Any]:
        """Matrices by each input s: series of derivatives from series of these indices."""
        from cfem.predict.series.derivatives import input_derivatives  # which needs SciPy, as no shape does

        return input_derivatives(indices, self._to_box, self._n_a)

    def _at(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Basis (..., M) at an input; of the last single states it is kept, as most are asked for several things."""
        if s.ndim > 1:
            return self._basis(self._box(s, q))
        key = s.tobytes(), q.tobytes()
        if key not in self._last:
            if len(self._last) >= LAST:
                del self._last[next(iter(self._last))]
            self._last[key] = self._basis(self._box(s, q))
        return self._last[key]

    def _box(self, s: np.ndarray, q: np.ndarray) -> np.ndarray:
        t = np.concatenate([s, q], axis=-1) if q.shape[-1] else s
        return t @ self._to_box.T + self._offset
