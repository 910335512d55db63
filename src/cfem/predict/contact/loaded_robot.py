"""A learned robot at held actuators, under forces on patches of its surface (`cfem.predict.contact.patched_model`).

How its rows go is known to the second order in the load w on the modes of the skin:

    rows = rows_0 + C_ss w + Q D_ss[v, v] / 2 + ...        v = Q^T w

with the mixtures Q of the modes that matter to D (`PatchedModel.bends`). The orders beyond follow as far as the energy
along the load tells them (`cfem.predict.loads.high_order`). So do the dents, by which a force on a patch changes what
this patch yields. Nodes, which are close to each other, have joint dents instead (`cfem.predict.contact.joint_dents`).
All of it is the derivative of one energy by the forces, so that the compliance is symmetric.

A wrench on the effectors, such as weight, moves the rows to its second order, and changes their compliance to its
first."""

import numpy as np

from cfem.predict.contact.compliance import LoadResponse, PatchCompliance, load_response
from cfem.predict.contact.joint_dents import DentedPlaces, JointDents, dented_places
from cfem.predict.contact.surface_model import NONE, SurfaceModel

THIRD = 2.5  # the third order over the square of the second, both relative to the first (docs/contact.md)


class LoadedRobot:
    """The robot at one delta (n_a,) mm, under a constant wrench (n_e,) on its effectors, None: none.

    unloaded (k,) mm: rows of the skin without forces on patches, and free (N, 3) mm: places of the patches then
    C_es (n_e, k) and C_ss (k, k) mm/N: compliance of effectors and rows to loads on the modes
    patches (c,), forces (c, 3) N: patches and what is on them since `load`, none at first
    w (k,) N: load of the forces on the modes, and rows (k,) mm under it
    error: estimate of how far what forces do is off, a share of it, the largest of all `load`; see `estimated_error`"""

    def __init__(self, model: SurfaceModel, delta: np.ndarray, wrench: np.ndarray | None = None):
        """Evaluates the model's series at delta (n_a,) mm, without forces on patches."""
        skin, k = model.model.skin, len(model.model.skin)
        self.model, self.delta, self.unloaded = model, delta, skin.rows(delta, NONE)
        self.C_es, self.C_ss = skin.compliance(delta, NONE)
        self.wrench, self._basis = wrench, model.basis(model.in_box(delta))
        if wrench is not None:
            change = wrench @ np.tensordot(self._basis, model.bent_by_wrench, axes=1)
            by_wrench, among_rows = np.split(change, [len(wrench)], axis=1)
            self.unloaded = self.unloaded + wrench @ (self.C_es + by_wrench.T / 2)
            self.C_es, self.C_ss = self.C_es + by_wrench.T, self.C_ss + among_rows
        self._D = (self._basis @ model.bent)[model.bent_at]
        self.free = model.patches.rest + (model.flat @ self.unloaded).reshape(-1, 3)
        if wrench is not None:
            series, every = model.local_tip, np.arange(len(self.free))
            local = wrench @ (self._basis @ series.reshape(len(series), -1)).reshape(len(wrench), -1)
            self.free += (model.turns(self.unloaded, every) @ local.reshape(-1, 3, 1))[:, :, 0]
        self._known: tuple[bytes, PatchCompliance, JointDents | None] | None = None
        self._response: LoadResponse | None = None
        self._dented: DentedPlaces | None = None
        self._pressed = np.zeros(len(model.patches), dtype=bool)  # once, so that rounds do not alternate
        self._places: np.ndarray | None = None
        self.patches, self.forces = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self.w, self.rows, self.error = np.zeros(k), self.unloaded, 0.0

    def load(self, patches: np.ndarray, forces: np.ndarray) -> None:
        """Puts forces (c, 3) N on patches (c,), and takes all others off."""
        self.patches, self.forces, self._places, self._dented = patches, forces, None, None
        if not len(patches):
            self.w, self.rows = np.zeros(len(self.unloaded)), self.unloaded
            return
        free, forces = self._compliance_of(patches), np.ascontiguousarray(forces, float)
        self._response = load_response(
            forces, self.C_ss, self.model.bends, self._D, free.U, free.flexibility, free.dents
        )
        self.w, self.rows = self._response.w, self.unloaded + self._response.modes.motion
        self.error = max(self.error, estimated_error(self._response.bending, self.model.missing))
        joint = self._known[2]
        if joint is not None and forces.any():
            self._pressed[patches[forces.any(axis=1)]] = True
            self._dented = dented_places(forces, free.total, joint, self._pressed[patches])
            if self._dented.share < 1:
                self.error = np.inf

    def places(self) -> np.ndarray:
        """(N, 3) mm of all patches. What is local is known of the loaded ones alone."""
        if not len(self.patches):
            return self.free
        if self._places is None:
            self._places = self.free + (self.model.flat @ self._response.modes.motion).reshape(-1, 3)
            local = (self._compliance_of(self.patches).local @ self.forces.ravel()).reshape(-1, 3)
            dents = self._response.places if self._dented is None else self._dented.places
            self._places[self.patches] += local + dents
        return self._places

    def compliance(self) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of the loaded patches' places by the forces on them, symmetric."""
        free, c, n_e = self._compliance_of(self.patches), len(self.patches), len(self.C_es)
        if not self.w.any():
            return free.total
        modes, each = self._response.modes, np.arange(c)
        across, V = free.U @ modes.across, free.U @ self.model.bends
        change = modes.second * (V @ self._response.change[n_e:] @ V.T) + modes.rank * np.outer(across, across)
        compliance = free.total + (modes.first - 1) * (free.total - free.local) + change
        compliance.reshape(c, 3, c, 3)[each, :, each] += self._response.slopes
        return compliance if self._dented is None else compliance + self._dented.slopes

    def free_compliance(self, patches: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N: the same of any patches without forces, symmetric and positive semidefinite."""
        return self._compliance_of(patches).total

    def alone(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacements (n_e,) mm of the effectors and forces (n_a,) N of the actuators without forces on patches."""
        if self.wrench is None:
            condensed = self.model.model.at_displacement(self.delta)
            return condensed.delta_e, condensed.lambda_a
        loaded = self.model.wrenches.at(self.delta).under(self.wrench)
        return loaded.e, loaded.lam

    def effector_motion(self) -> np.ndarray:
        """(n_e,) mm by which the forces move the effectors."""
        n_e = len(self.C_es)
        if not len(self.patches):
            return np.zeros(n_e)
        free, response = self._compliance_of(self.patches), self._response
        series = self.model.local_tip[:, :, self.patches].reshape(len(self._basis), -1)
        turned = (self.forces[:, None] @ free.R)[:, 0]
        local = (self._basis @ series).reshape(n_e, -1) @ turned.ravel()
        pairs = response.seconds[:, None, None] / 2 * self.forces[:, :, None] * self.forces[:, None]
        dents = pairs.ravel() @ free.dents[..., 3:].reshape(-1, n_e)
        second = response.modes.second / 2 * response.change[:n_e] @ response.v
        return response.modes.first * self.C_es @ self.w + second + local + dents

    def stored(self) -> float:
        """N mm that the forces have stored beside what the actuators have: their work, less the integral of places over
        forces. Of the latter the orders w . C w and D[w, w, w] have 1/2 and 1/6 (`cfem.predict.loads.high_order`), and
        of the work 1 and 1/2."""
        if not self.forces.any():
            return 0.0
        free, response, f = self._compliance_of(self.patches), self._response, self.forces
        flexible = free.flexibility * (f**2).sum(axis=1)
        dents = 2 / 3 * ((f * response.places).sum(axis=1) + flexible) - response.firsts * flexible / 6 - flexible / 2
        local = f.ravel() @ free.local @ f.ravel() / 2
        modes = 2 / 3 * self.w @ response.modes.motion - response.modes.first * self.w @ self.C_ss @ self.w / 6
        joint = 0.0 if self._dented is None else self._dented.energy
        return float(modes + local + dents.sum() + joint)

    def relief(self) -> np.ndarray:
        """(n_a,) N by which the forces help the actuators to stay."""
        skin, w = self.model.model.skin, self.w
        if not len(self.patches):
            return np.zeros(len(self.delta))
        modes, v = self._response.modes, self._response.v
        linear = w @ skin.gradient(self.delta, NONE) + modes.first * skin.compliance_work(self.delta, NONE, w) / 2
        if self.wrench is not None:
            linear = linear + skin.wrench_work(self.delta, NONE, self.wrench, w)
        series, (i, j, k), slopes = self.model.cubic
        return linear + modes.second / 6 * (self._basis @ slopes @ (series @ (v[i] * v[j] * v[k])))

    def _compliance_of(self, patches: np.ndarray) -> PatchCompliance:
        """Compliance of patches (c,) without forces, kept for the next call. Where it is not positive definite, the
        nearest semidefinite matrix takes its place."""
        key = patches.tobytes()
        if self._known is None or self._known[0] != key:
            model, R = self.model, self.model.turns(self.unloaded, patches)
            U, local, total, dents = model.compliance(patches, self.C_ss, R, self._basis, self.delta)
            try:
                np.linalg.cholesky(total)
            except np.linalg.LinAlgError:
                sizes, axes = np.linalg.eigh(total)
                nearest = (axes * np.maximum(sizes, 0.0)) @ axes.T
                local, total = local + (nearest - total), nearest
            c, diagonal = len(patches), np.arange(len(patches))
            flexibility = stiff_flexibility(total.reshape(c, 3, c, 3)[diagonal, :, diagonal])
            self._known = key, PatchCompliance(U, local, total, flexibility, R, dents), model.joint_dents(patches, R)
        return self._known[1]


def estimated_error(bending: float, missing: float) -> float:
    """Estimate of how far what forces do is off, a share of it: what modes miss of the second order
    (`SurfaceModel.missing`), and the orders beyond. bending: second order over first.

    A slender body that is bent sideways comes nearer by 0.6 of the square of its deflection, both over its length, and
    stiffens by about that square: the third order goes with the square of the second."""
    return (missing + THIRD * bending) * bending


def stiff_flexibility(compliance: np.ndarray) -> np.ndarray:
    """Harmonic means (c,) of the eigenvalues of `compliance` (c, 3, 3) mm/N, near those of what is local: a soft body
    yields in one or two directions, and is dented in all; 0 where the body is held."""
    minors = sum(
        compliance[:, i, i] * compliance[:, j, j] - compliance[:, i, j] ** 2 for i, j in ((0, 1), (0, 2), (1, 2))
    )
    return 3 * np.linalg.det(compliance) / np.where(minors > 0, minors, np.inf)
