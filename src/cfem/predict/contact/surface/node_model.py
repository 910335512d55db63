"""A learned robot that touches with every node of its surface.

With R_i the rotation of the surface around node i since rest, the compliance of the nodes is

    C_ij = R_i (Phi_i K(delta) Phi_j^T + L_ij(delta)) R_j^T

with modes Phi of the compliance, and L between nodes that are near each other, by finite elements
(`cfem.equilibrium.contact.node_compliance`). K is a polynomial in delta as in
`cfem.predict.contact.surface.surface_model`, L a linear one. What the modes of the skin do under loads, to all orders,
is known as with patches. Forces on nodes that are close to each other also change what these nodes yield, by dents
(`cfem.equilibrium.contact.node_dents`), which in the turning frames are the same in all states."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.condensed.patches import Patches
from cfem.contact.touching_facets import Facets
from cfem.core.errors import InputError
from cfem.equilibrium.contact.node_compliance import NodeResponse
from cfem.mechanics.surface_turns import rotations
from cfem.predict.contact.surface.surface_model import NONE, ComplianceParts, JointDents, SurfaceModel
from cfem.predict.protocol import Predictor

MODES = 80  # of the compliance
NEAR = 0.05  # of the length: nodes between which what the modes leave is known
DENTED = 0.028  # of the length: nodes that dent each other
KEPT, FEW = 16, 64  # choices of nodes whose series are kept, and of how many nodes at most
ONE = np.ones(1)


class NodeSeries(NamedTuple):
    """Arrays of nodes (c,) near obstacles that are the same in all states of the robot.

    spread: (c, 3, 3), by_row: (c, 3, 3, k), of `SurfaceModel.turns`
    U: (3 c, k) skin's modes at the nodes
    between: (m, 3 c, 3 c) mm/N, series of Phi K Phi^T + L in the frames at rest
    tip: (terms, n_e, c, 3) mm/N, of `SurfaceModel.local_tip`
    first (c + 1,), triples (t, 3), dented (t, 3, 3, 3) mm/N^2: as `_dents` takes them, of these nodes alone"""

    spread: np.ndarray
    by_row: np.ndarray
    U: np.ndarray
    between: np.ndarray
    tip: np.ndarray
    first: np.ndarray
    triples: np.ndarray
    dented: np.ndarray


@dataclass(frozen=True)
class NodeModel(SurfaceModel):
    """A model with a skin, its nodes as patches of one node (`node_patches`), and how they yield by finite elements."""

    by_fe: NodeResponse
    most = 400

    def __post_init__(self) -> None:
        super().__post_init__()
        n, given = 3 * len(self.patches), (self.by_fe.modes, self.by_fe.by_modes, self.by_fe.left)
        if len(self.by_fe.modes) != n or not all(np.isfinite(each).all() for each in given):
            raise InputError(f"expected the finite compliance of {n // 3} nodes")

    @cached_property
    def flexibility(self) -> np.ndarray:
        by_fe, n = self.by_fe, len(self.patches)
        own = by_fe.left[:, by_fe.pairs[:, 0] == by_fe.pairs[:, 1]].mean(axis=0)
        by_modes = (self._modes @ by_fe.by_modes.mean(axis=0) * self._modes).sum(axis=1).reshape(n, 3)
        return by_modes + np.diagonal(own, axis1=1, axis2=2)

    @cached_property
    def facets(self) -> Facets:
        skin, still = self.model.skin, self.held_still
        return Facets.of(skin.triangles[~still[skin.triangles].any(axis=1)], skin.rest)

    @cached_property
    def local_tip(self) -> np.ndarray:
        model, tip, count = self.model, [], len(self.patches)
        for delta, to_tip in zip(self.by_fe.states, self.by_fe.tip, strict=True):
            R = self.turns(model.skin.rows(delta, NONE), np.arange(count))
            by_modes = model.skin.compliance(delta, NONE)[0] @ self.flat.T
            tip.append(to_tip.reshape(-1, count, 3) - (by_modes.reshape(-1, count, 1, 3) @ R)[:, :, 0])
        return np.tensordot(self._inverse, np.stack(tip), axes=1)

    def compliance(self, points: np.ndarray, rows: np.ndarray, C_ss: np.ndarray, basis: np.ndarray) -> ComplianceParts:
        if len(points) <= FEW:
            U, left, total, tip, *joint = _of_nodes(rows, C_ss, basis, basis, self._kept(points))
        else:
            U, left, total, tip, *joint = _of_nodes(rows, C_ss, basis, ONE, self._series(points, basis[None]))
        return U, left, total, np.zeros((len(points), 3, 3, 3 + len(tip))), tip, JointDents(*joint)

    def _kept(self, points: np.ndarray) -> "NodeSeries":
        """Series of few nodes (c,), kept for states to come."""
        kept, key = self._last, points.tobytes()
        if key not in kept:
            if len(kept) >= KEPT:
                del kept[next(iter(kept))]
            kept[key] = self._series(points, np.eye(len(self.degrees)))
        return kept[key]

    def _series(self, points: np.ndarray, terms: np.ndarray) -> "NodeSeries":
        """`NodeSeries` of nodes (c,), of these combinations (m, terms) of the terms of the series between them."""
        c, k, fe = len(points), self._modes.shape[1], self.by_fe
        still, modes, between = np.tile(np.eye(3), (c, 1, 1)), self._modes.reshape(-1, 3, k)[points].reshape(-1, k), []
        for term in terms:
            between.append(modes @ (term @ self._by_modes).reshape(k, k) @ modes.T)
            linear = term[: len(self._left)]  # the first ones of the series of K
            _add_local(between[-1], points, linear, self._first, fe.pairs[:, 1], self._left)
        triples, dented = _dents(points, still, self._first_triple, fe.triples, self._dented)
        first = np.searchsorted(triples[:, 0], np.arange(c + 1))
        joint = first, triples.astype(fe.triples.dtype), dented.astype(np.float32)
        turns, tip = (self.spread[0][points], self._spread_by_row[points]), self.local_tip[:, :, points]
        return NodeSeries(*turns, self.U[points].reshape(3 * c, -1), np.stack(between), tip, *joint)

    @cached_property
    def _last(self) -> dict[bytes, "NodeSeries"]:
        return {}

    @cached_property
    def _modes(self) -> np.ndarray:
        return self.by_fe.modes.astype(float)

    @cached_property
    def _by_modes(self) -> np.ndarray:
        """(terms, k k) mm/N, series of K."""
        return self._inverse @ self.by_fe.by_modes.reshape(len(self.by_fe.states), -1)

    @cached_property
    def _first(self) -> np.ndarray:
        """(m + 1,) where the pairs of each node begin."""
        return np.searchsorted(self.by_fe.pairs[:, 0], np.arange(len(self.patches) + 1))

    @cached_property
    def _first_triple(self) -> np.ndarray:
        """(m + 1,) where the triples of each node begin."""
        return np.searchsorted(self.by_fe.triples[:, 0], np.arange(len(self.patches) + 1))

    @cached_property
    def _dented(self) -> np.ndarray:
        """(t, 3, 3, 3) mm/N^2"""
        return self.by_fe.dented.astype(np.float32)

    @cached_property
    def _left(self) -> np.ndarray:
        """(1 + n_a, p, 3, 3) mm/N, linear in the place in the box."""
        places = self.in_box(self.by_fe.states[self.by_fe.local])
        linear = np.column_stack([np.ones(len(places)), places])
        series = np.tensordot(np.linalg.pinv(linear), self.by_fe.left.astype(float), axes=1)
        return series.astype(np.float32)


def node_patches(model: Predictor) -> Patches:
    """Each node of a model's skin as a patch."""
    count = len(model.skin.rest)
    return Patches(np.arange(count), np.ones(count), model.skin.rest)


@njit(cache=True, error_model="numpy")
def _of_nodes(rows, C_ss, basis, terms, nodes):
    """U, local, total and tip of `PointCompliance`, and the fields of `JointDents`, of nodes where the skin's rows are
    (k,) mm; C_ss (k, k) mm/N; basis (terms,), and terms (m,) of what is between the nodes."""
    n, U = len(nodes.U), nodes.U
    c, spreads, half = n // 3, nodes.spread.copy(), np.empty((3, 3))
    for i in range(c):
        for a in range(3):
            for b in range(3):
                for d in range(len(rows)):
                    spreads[i, a, b] += rows[d] * nodes.by_row[i, a, b, d]
    R, total, between = rotations(spreads), np.empty((n, n)), np.zeros((n, n))
    for term in range(len(terms)):
        for i in range(n):
            for j in range(n):
                between[i, j] += terms[term] * nodes.between[term, i, j]
    for i in range(c):
        for j in range(c):
            L = between[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
            for a in range(3):
                for b in range(3):
                    half[a, b] = R[i, a, 0] * L[0, b] + R[i, a, 1] * L[1, b] + R[i, a, 2] * L[2, b]
            for a in range(3):
                for b in range(3):
                    value = half[a, 0] * R[j, b, 0] + half[a, 1] * R[j, b, 1] + half[a, 2] * R[j, b, 2]
                    total[3 * i + a, 3 * j + b] = value
    tip, f = np.zeros((nodes.tip.shape[1], n)), np.empty(3)
    for e in range(len(tip)):
        for i in range(c):
            f[:] = 0.0
            for term in range(len(basis)):
                for a in range(3):
                    f[a] += basis[term] * nodes.tip[term, e, i, a]
            for a in range(3):
                tip[e, 3 * i + a] = R[i, a, 0] * f[0] + R[i, a, 1] * f[1] + R[i, a, 2] * f[2]
    triples, turned = _dents(np.arange(c), R, nodes.first, nodes.triples, nodes.dented)
    return U, total - U @ C_ss @ U.T, total, tip, triples, turned


@njit(cache=True, error_model="numpy")
def _add_local(total, points, linear, first, second, left):
    """Adds L of points (c,) that are near each other, in the frames at rest, to total (3 c, 3 c); the pairs of node i
    are first[i] to first[i + 1], with the nodes `second` (p,)."""
    place = np.full(len(first) - 1, -1)
    for i in range(len(points)):
        place[points[i]] = i
    for i in range(len(points)):
        for pair in range(first[points[i]], first[points[i] + 1]):
            j = place[second[pair]]
            if j < 0:
                continue
            for a in range(3):
                for b in range(3):
                    value = 0.0
                    for term in range(len(linear)):
                        value += linear[term] * left[term, pair, a, b]
                    total[3 * i + a, 3 * j + b] += value
                    if i != j:
                        total[3 * j + b, 3 * i + a] += value


@njit(cache=True, error_model="numpy")
def _dents(points, R, first, triples, dented):
    """Triples (t, 3) of points (c,), by their places among these, and their dents (t, 3, 3, 3) mm/N^2 turned by R
    (c, 3, 3); the triples of node i are first[i] to first[i + 1]."""
    place = np.full(len(first) - 1, -1)
    for i in range(len(points)):
        place[points[i]] = i
    count = 0
    for point in points:
        for t in range(first[point], first[point + 1]):
            count += place[triples[t, 1]] >= 0 and place[triples[t, 2]] >= 0
    chosen, turned = np.empty((count, 3), dtype=np.int64), np.zeros((count, 3, 3, 3))
    half, more, n = np.empty((3, 3, 3)), np.empty((3, 3, 3)), 0
    for point in points:
        for t in range(first[point], first[point + 1]):
            i, j, k = place[point], place[triples[t, 1]], place[triples[t, 2]]
            if j < 0 or k < 0:
                continue
            chosen[n, 0], chosen[n, 1], chosen[n, 2] = i, j, k
            for a in range(3):
                for b in range(3):
                    for d in range(3):
                        half[a, b, d] = 0.0
                        for p in range(3):
                            half[a, b, d] += R[i, a, p] * dented[t, p, b, d]
            for a in range(3):
                for b in range(3):
                    for d in range(3):
                        more[a, b, d] = 0.0
                        for p in range(3):
                            more[a, b, d] += R[j, b, p] * half[a, p, d]
            for a in range(3):
                for b in range(3):
                    for d in range(3):
                        for p in range(3):
                            turned[n, a, b, d] += R[k, d, p] * more[a, b, p]
            n += 1
    return chosen, turned
