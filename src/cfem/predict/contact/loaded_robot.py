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

from cfem.predict.contact.compliance import LoadResponse, PatchCompliance, load_response, moved_places, under_forces
from cfem.predict.contact.held_robot import held
from cfem.predict.contact.joint_dents import DentedPlaces, JointDents, dented_places
from cfem.predict.contact.surface_model import SurfaceModel

THIRD = 2.5  # the third order over the square of the second, both relative to the first (docs/contact.md)


class LoadedRobot:
    """The robot at one delta (n_a,) mm, under a constant wrench (n_e,) on its effectors, None: none.

    held: the robot there, its surface free, and free (N, 3) mm: places of the patches then
    patches (c,), forces (c, 3) N: patches and what is on them since `load`, none at first
    w (k,) N: load of the forces on the modes, and rows (k,) mm under it
    bears: whether any of the forces is not 0
    error: estimate of how far what forces do is off, a share of it, the largest of all `load`; see `estimated_error`"""

    def __init__(self, model: SurfaceModel, delta: np.ndarray, wrench: np.ndarray | None = None):
        """At delta (n_a,) mm, without forces on patches."""
        self.model, self.delta, self.wrench, self.held = model, delta, wrench, held(model, delta, wrench)
        self.free = model.patches.rest + (model.flat @ self.held.rows).reshape(-1, 3)
        if wrench is not None:
            series, every = model.local_tip, np.arange(len(self.free))
            local = wrench @ (self.held.basis @ series.reshape(len(series), -1)).reshape(len(wrench), -1)
            self.free += (model.turns(self.held.rows, every) @ local.reshape(-1, 3, 1))[:, :, 0]
        self._known: tuple[np.ndarray, tuple[PatchCompliance, JointDents | None]] | None = None
        self._response: LoadResponse | None = None
        self._dented: DentedPlaces | None = None
        self._pressed = np.zeros(len(self.free), dtype=bool)  # once, so that rounds do not alternate
        self._places: np.ndarray | None = None
        self.patches, self.forces = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        self.w, self.rows, self.error, self.bears = np.zeros(len(self.held.rows)), self.held.rows, 0.0, False

    def load(self, patches: np.ndarray, forces: np.ndarray) -> None:
        """Puts forces (c, 3) N on patches (c,), and takes all others off."""
        known, dented = self.patches, self._dented
        self.patches, self.forces, self._places, self._dented = patches, forces, None, None
        if not len(patches):
            self.w, self.rows, self.bears = np.zeros(len(self.held.rows)), self.held.rows, False
            return
        (free, joint), held = self._compliance_of(patches), self.held
        self._response = response = load_response(
            forces, held.C_ss, held.bends, held.D, free.U, free.flexibility, free.dents
        )
        self.w, self.rows, self.bears = response.w, held.rows + response.modes.motion, response.bears
        self.error = max(self.error, estimated_error(response.bending, held.missing))
        if joint is not None and self.bears:
            pressed = self._pressed[patches] | (forces != 0.0).any(axis=1)
            self._pressed[patches] = pressed
            near = dented if known is patches else None
            self._dented = dented_places(forces, free.total, joint, pressed, near)
            if self._dented.share < 1:
                self.error = np.inf

    def places(self) -> np.ndarray:
        """(N, 3) mm of all patches. What is local is known of the loaded ones alone."""
        if not len(self.patches):
            return self.free
        if self._places is None:
            local = self._compliance_of(self.patches)[0].local
            dents = self._response.places if self._dented is None else self._dented.places
            motion = self._response.modes.motion
            self._places = moved_places(self.free, self.model.flat, motion, self.patches, local, self.forces, dents)
        return self._places

    def compliance(self) -> np.ndarray:
        """(3 c, 3 c) mm/N: derivative of the loaded patches' places by the forces on them, symmetric."""
        free, response = self._compliance_of(self.patches)[0], self._response
        if not self.bears:
            return free.total
        change = response.change[len(self.held.C_es) :]
        by_modes = free.total, free.local, free.U, self.held.bends, change, response.slopes
        compliance = under_forces(*by_modes, *response.modes[1:])
        return compliance if self._dented is None else compliance + self._dented.slopes

    def free_compliance(self, patches: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N: the same of any patches without forces, symmetric and positive semidefinite."""
        return self._compliance_of(patches)[0].total

    def effector_motion(self) -> np.ndarray:
        """(n_e,) mm by which the forces move the effectors."""
        n_e = len(self.held.C_es)
        if not len(self.patches):
            return np.zeros(n_e)
        free, response = self._compliance_of(self.patches)[0], self._response
        series = self.model.local_tip[:, :, self.patches].reshape(len(self.held.basis), -1)
        turned = (self.forces[:, None] @ free.R)[:, 0]
        local = (self.held.basis @ series).reshape(n_e, -1) @ turned.ravel()
        pairs = response.seconds[:, None, None] / 2 * self.forces[:, :, None] * self.forces[:, None]
        dents = pairs.ravel() @ free.dents[..., 3:].reshape(-1, n_e)
        second = response.modes.second / 2 * response.change[:n_e] @ response.v
        return response.modes.first * self.held.C_es @ self.w + second + local + dents

    def stored(self) -> float:
        """N mm that the forces have stored beside what the actuators have: their work, less the integral of places over
        forces. Of the latter the orders w . C w and D[w, w, w] have 1/2 and 1/6 (`cfem.predict.loads.high_order`), and
        of the work 1 and 1/2."""
        if not self.bears:
            return 0.0
        free, response, f = self._compliance_of(self.patches)[0], self._response, self.forces
        flexible = free.flexibility * (f**2).sum(axis=1)
        dents = 2 / 3 * ((f * response.places).sum(axis=1) + flexible) - response.firsts * flexible / 6 - flexible / 2
        local = f.ravel() @ free.local @ f.ravel() / 2
        modes = 2 / 3 * self.w @ response.modes.motion - response.modes.first * self.w @ self.held.C_ss @ self.w / 6
        joint = 0.0 if self._dented is None else self._dented.energy
        return float(modes + local + dents.sum() + joint)

    def relief(self) -> np.ndarray:
        """(n_a,) N by which the forces help the actuators to stay."""
        if not len(self.patches):
            return np.zeros(len(self.delta))
        held, w, modes, v = self.held, self.w, self._response.modes, self._response.v
        cubic, (i, j, k) = held.cubic
        linear = held.gradient @ w + modes.first / 2 * (held.compliance_slopes @ w @ w)
        return linear + modes.second / 6 * (cubic @ (v[i] * v[j] * v[k]))

    def _compliance_of(self, patches: np.ndarray) -> tuple[PatchCompliance, JointDents | None]:
        """Compliance of patches (c,) without forces, kept for the next call, and their joint dents."""
        if self._known is None or not (self._known[0] is patches or np.array_equal(self._known[0], patches)):
            self._known = patches, self.held.compliance_of(self.model.numbers[patches])
        return self._known[1]


def estimated_error(bending: float, missing: float) -> float:
    """Estimate of how far what forces do is off, a share of it: what modes miss of the second order
    (`SurfaceModel.missing`), and the orders beyond. bending: second order over first.

    A slender body that is bent sideways comes nearer by 0.6 of the square of its deflection, both over its length, and
    stiffens by about that square: the third order goes with the square of the second."""
    return (missing + THIRD * bending) * bending
