"""A learned robot at held actuators whose surface is free: what all forces on it have in common.

It depends on the displacements of the actuators and on the wrench alone. Robots of one model that are held alike share
it, and so do the rounds of a step and steps in which actuators stay (`held`)."""

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numba import njit

from cfem.predict.contact.forces.joint_dents import factorise
from cfem.predict.contact.surface.surface_model import NONE, SurfaceModel

HELD = 8  # states of held actuators that are kept of a model
KEPT, FEW = 8, 64  # compliances that are kept, and of how many points at most


class PointCompliance(NamedTuple):
    """Compliance of points (c,) of the surface without forces, without the modes' part in `RobotNumbers`.

    numbers: the later fields of `RobotNumbers`, from U on, joined: U (3 c, k) of the modes; local (3 c, 3 c) mm/N, what
        the modes leave of the compliance, and total (3 c, 3 c) mm/N, all of it; flexibility (c,) mm/N of each point in
        its stiff directions; dents (c, 3, 3, 3 + n_e) mm/N^2, change of the compliance of each point, with itself and
        with the effectors, with a force on it; tip (n_e, 3 c) mm/N, what the modes leave of the effectors' compliance;
        change of `JointDents`. In the robot's axes
    triples: of `JointDents`, None where each point dents by itself"""

    numbers: np.ndarray
    triples: np.ndarray | None


NO_POINTS = PointCompliance(np.zeros(0), None)


class HeldRobot:
    """The robot at one delta (n_a,) mm, under a constant wrench (n_e,) on its effectors, None: none.

    rows: (k,) mm of the skin
    C_es (n_e, k) and C_ss (k, k) mm/N: compliance of effectors and rows to loads on the modes
    basis: (terms,) values of the series of what is local
    D: (r, n_e + r, r) mm/N^2, how loads on the mixtures `bends` (k, r) of the modes change C_es and C_ss
    missing: `SurfaceModel.missing`"""

    def __init__(self, model: SurfaceModel, delta: np.ndarray, wrench: np.ndarray | None):
        """Evaluates the model's series at delta (n_a,) mm."""
        skin = model.model.skin
        self.model, self.delta, self.wrench, self.rows = model, delta, wrench, skin.rows(delta, NONE)
        self.C_es, self.C_ss = skin.compliance(delta, NONE)
        self.basis = model.basis(model.in_box(delta))
        if wrench is not None:
            change = wrench @ np.tensordot(self.basis, model.bent_by_wrench, axes=1)
            by_wrench, among_rows = np.split(change, [len(wrench)], axis=1)
            self.rows = self.rows + wrench @ (self.C_es + by_wrench.T / 2)
            self.C_es, self.C_ss = self.C_es + by_wrench.T, self.C_ss + among_rows
        self.D, self.bends, self.missing = (self.basis @ model.bent).take(model.bent_at), model.bends, model.missing
        self.numbers = joined(np.array([self.missing]), self.rows, self.C_es, self.C_ss, self.bends, self.D)
        self._points: dict[bytes, PointCompliance] = {}

    def compliance_of(self, points: np.ndarray) -> PointCompliance:
        """Compliance of points (c,) of the surface. Where it is not positive definite, the nearest semidefinite matrix
        takes its place."""
        if not len(points):
            return NO_POINTS
        if len(points) > FEW:
            return self._found(points)
        key = points.tobytes()
        if key not in self._points:
            if len(self._points) >= KEPT:
                del self._points[next(iter(self._points))]
            self._points[key] = self._found(points)
        return self._points[key]

    def _found(self, points: np.ndarray) -> PointCompliance:
        """Compliance of points (c,), the nearest semidefinite one where the model's is indefinite."""
        U, local, total, dents, tip, joint = self.model.compliance(points, self.rows, self.C_ss, self.basis)
        if not factorise(total.copy()):
            sizes, axes = np.linalg.eigh(total)
            nearest = (axes * np.maximum(sizes, 0.0)) @ axes.T
            local, total = local + (nearest - total), nearest
        change, triples = (np.zeros(0), None) if joint is None else (joint.change, joint.triples)
        return PointCompliance(joined(U, local, total, stiff_flexibility(total), dents, tip, change), triples)

    @cached_property
    def alone(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (n_e,) mm of the effectors and forces (n_a,) N of the actuators."""
        if self.wrench is None:
            return self.model.model.ends_at_displacement(self.delta)
        loaded = self.model.wrenches.at(self.delta).under(self.wrench)
        return loaded.e, loaded.lam

    @cached_property
    def gradient(self) -> np.ndarray:
        """(n_a, k) mm per mm: derivatives of the rows by the actuators under the wrench, to its first order."""
        gradient = self.model.model.skin.gradient(self.delta, NONE).T
        return gradient if self.wrench is None else gradient + self.wrench @ self._compliance_slopes[0]

    @property
    def compliance_slopes(self) -> np.ndarray:
        """(n_a, k, k) 1/N: derivatives of C_ss by the actuators."""
        return self._compliance_slopes[1]

    @cached_property
    def _compliance_slopes(self) -> tuple[np.ndarray, np.ndarray]:
        return self.model.model.skin.compliance_slopes(self.delta, NONE)

    @cached_property
    def answers(self) -> np.ndarray:
        """Both of `alone`, and how forces on the surface relieve the actuators, joined: `gradient`, `compliance_slopes`
        and (n_a, c) 1/N^2, derivatives by the actuators of D[v, v, v], v loads on three mixtures i <= j <= k each."""
        series, slopes = self.model.cubic
        return joined(*self.alone, self.gradient, self.compliance_slopes, self.basis @ slopes @ series)


def joined(*arrays: np.ndarray) -> np.ndarray:
    """All numbers of the arrays, one after another."""
    return np.concatenate([array.reshape(-1) for array in arrays])


def held(model: SurfaceModel, delta: np.ndarray, wrench: np.ndarray | None = None) -> HeldRobot:
    """The robot at held actuators, delta (n_a,) mm, under a wrench (n_e,) on its effectors: kept for the next call."""
    key = delta.tobytes(), None if wrench is None else wrench.tobytes()
    if key not in model.kept:
        if len(model.kept) >= HELD:
            del model.kept[next(iter(model.kept))]
        model.kept[key] = HeldRobot(model.whole, delta.copy(), wrench)
    return model.kept[key]


@njit(cache=True, error_model="numpy")
def stiff_flexibility(compliance):
    """Harmonic means (c,) of the eigenvalues of the blocks of points on the diagonal of `compliance` (3 c, 3 c) mm/N,
    near those of what is local: a soft body yields in one or two directions, and is dented in all; 0 where the body is
    held."""
    means = np.zeros(len(compliance) // 3)
    for p in range(len(means)):
        C, minors, determinant = compliance[3 * p : 3 * p + 3, 3 * p : 3 * p + 3], 0.0, 0.0
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            minors += C[i, i] * C[j, j] - C[i, j] ** 2
            determinant += C[0, i] * (C[1, j] * C[2, k] - C[1, k] * C[2, j])
        if minors > 0:
            means[p] = 3 * determinant / minors
    return means
