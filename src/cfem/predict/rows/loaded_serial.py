"""Modules in a row under loads, each known by one unloaded model of its own.

Module i answers to the wrench w_i on its rows (force, and moment conjugate to the rotation vector, at its end; its
weight on its centre of mass) with the pose e_i = E_i(delta_i, w_i) of these, in the frame at its base
(`cfem.predict.loads.wrench_series`). The effectors y(e_1, ..., e_k) of the whole, its tip and its centre of mass, carry
the wrench w of potential V = -w . y: w_i = -dV/de_i, and the poses follow from

    e - E(delta, -dV/de) = 0        Newton, with the Jacobian 1 + C V_ee

where C = dE/dw is of blocks. With S = (1 + C V_ee)^-1, G = dE/d delta, K = d lambda / d delta of the modules and
B = dy/de, the condensed row of modules has (implicit differentiation)

    d lambda / d delta = K + G^T V_ee S G        dy / d delta = B S G        dy / dw = B S C B^T

Gravity is a force on the centre of mass of the whole, which is the mean of the modules' own."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from cfem.condensed.rotation import turn
from cfem.constraint.patch import PatchLoad
from cfem.core.errors import NumericalError
from cfem.predict.loads.loaded_rows import LEFT
from cfem.predict.loads.wrench_series import NEAR, Held, Loaded, WrenchSeries
from cfem.predict.rows.load_error import module_error
from cfem.predict.rows.patches import RowPatches
from cfem.predict.rows.serial import END, SerialPredictor
from cfem.predict.rows.serial_patches import row_patches, skins_within
from cfem.predict.series.energy import condense

ITERATIONS = 50
STEP = 1e-5  # of the reach: by which shapes are differenced
STATES = 16  # at which the error is estimated
FARTHEST = 6.0  # lengths of a module and radians: no pose of a module is farther away
TOLERANCE = 1e-11  # of a module's length and of a radian: largest Newton step of a converged row


@dataclass(frozen=True)
class RowKinematics:
    """Effectors of the whole robot and their derivatives by all N coordinates e.

    y: (n_e,) mm
    B, H: (n_e, N) and (n_e, N, N), first and second derivatives"""

    y: np.ndarray
    B: np.ndarray
    H: np.ndarray


def row_of(e: np.ndarray, rests: np.ndarray, shares: np.ndarray | None = None, places: int = 0) -> RowKinematics:
    """Kinematics of a row of k modules. e (k, p): displacement of each module's end from rest and rotation vector, in
    the frame at its base, that of its centre of mass, and those of `places` patches; rests (k, p) mm; shares (k,) of
    the modules in the mass, None where it is not asked."""
    (k, p), N, patches = e.shape, e.size, []
    A, dA, d2A = np.eye(3), np.zeros((N, 3, 3)), np.zeros((N, N, 3, 3))
    end, centre = _nowhere(N), _nowhere(N)
    for i, (local, rest, share) in enumerate(zip(e, rests, np.zeros(k) if shares is None else shares, strict=True)):
        first = p * i
        place, angle, centre_columns = (slice(first + column, first + column + 3) for column in (0, 3, END))
        if shares is not None:
            inner = _placed(A, dA, d2A, rest[END:][:3] + local[END:][:3], centre_columns)
            for total, before, more in zip(centre, end, inner, strict=True):
                total += share * (before + more)
        for column in range(p - 3 * places, p, 3):
            inner = _placed(
                A,
                dA,
                d2A,
                rest[column : column + 3] + local[column : column + 3],
                slice(first + column, first + column + 3),
            )
            patches.append([before + more for before, more in zip(end, inner, strict=True)])
        for total, more in zip(end, _placed(A, dA, d2A, rest[:3] + local[:3], place), strict=True):
            total += more
        R, slope, bent = turn(local[3:END])
        new, new2 = dA @ R, d2A @ R
        both = np.einsum("nab,jbc->njac", dA, slope)
        new2[:, angle] += both
        new2[angle, :] += both.swapaxes(0, 1)
        new2[angle, angle] += A @ bent
        new[angle] += A @ slope
        A, dA, d2A = A @ R, new, new2
    watched = [end, *([] if shares is None else [centre]), *patches]
    return RowKinematics(*(np.concatenate(each) for each in zip(*watched, strict=True)))


def _nowhere(N: int) -> list[np.ndarray]:
    return [np.zeros(3), np.zeros((3, N)), np.zeros((3, N, N))]


def _placed(A: np.ndarray, dA: np.ndarray, d2A: np.ndarray, x: np.ndarray, columns: slice) -> list[np.ndarray]:
    """Place A x with its derivatives, where A has its own and x is moved by the coordinates `columns`."""
    first, second = (dA @ x).T, np.moveaxis(d2A @ x, -1, 0).copy()
    first[:, columns] += A
    mixed = np.moveaxis(dA, 0, 1)  # (3, N, 3): by any coordinate, and by x
    second[:, :, columns] += mixed
    second[:, columns, :] += mixed.swapaxes(1, 2)
    return [A @ x, first, second]


class LoadedSerialPredictor(SerialPredictor):
    """Predictor of modules in a row under loads. meta has `wrench` (n_e,) N on the effectors of the whole too. patches:
    forces on its surface, which the modules' own skins bear: rows behind those of the pose. An exported one has them in
    `meta`, and these skins in `arrays`."""

    def __init__(self, meta: dict, arrays: dict[str, np.ndarray], patches: RowPatches | None = None):
        """Builds the modules' series with the rows of their patches."""
        super().__init__(meta, arrays)
        self.wrench = np.asarray(meta["wrench"], float)
        if patches is None and meta.get("patch_loads"):
            self.skin_source = lambda: skins_within(self.models, arrays)
            patches = row_patches(self, [PatchLoad(**load) for load in meta["patch_loads"]])
        self.patches, on = patches, patches or RowPatches.none(len(self.which))
        if patches is None:
            series = [WrenchSeries(model, self.pose) for model in self.models]
            self._series = [series[number] for number in self.which]
        else:
            self._series = []
            for model, skin, module_patches in zip(self.modules, patches.skins, patches.each, strict=True):
                model.skin_source = lambda skin=skin: skin
                self._series.append(WrenchSeries(model, self.pose, module_patches, patches.places))
        self._on, self._forces = on, np.concatenate([self.wrench, on.forces.ravel()])
        self._all_rests = np.hstack([self.rests, on.rests])

    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        states = [self._one(state) for state in s.reshape(-1, s.shape[-1])]
        W, free = (np.array(each).reshape(*s.shape[:-1], *each[0].shape) for each in zip(*states, strict=True))
        return W, free

    def wrench_error(self) -> float:
        """Estimated error of the tip, mm, where that is worst among the training states. Those are left out in which an
        actuator that only pulled in training (a chamber: only pushed) would have to do the other under the loads,
        unless it is so in all: no robot goes there."""
        n_a, known = self.rows.n_a, self.domain.states
        states = known[:: max(1, len(known) // STATES), :n_a]
        errors = np.array([self.error_at(state) for state in states])
        one_sided = known[:, n_a : 2 * n_a].min(axis=0) >= 0
        kept = np.array([(self.at(state).lam >= 0)[one_sided].all() for state in states])
        return float((errors[kept] if kept.any() else errors).max())

    def load_error(self, delta_a: np.ndarray) -> np.ndarray:
        """`error_at` of displacements (..., n_a): the largest of all states is many times that of most."""
        return np.array([self.error_at(each) for each in delta_a.reshape(-1, delta_a.shape[-1])]).reshape(
            delta_a.shape[:-1]
        )

    def error_at(self, delta_a: ArrayLike) -> float:
        """Estimated error of the tip, mm, at one state, n_a actuators. Without D as
        `cfem.predict.loads.loaded.wrench_error`. With it, the sum of what each module leaves out and is off, carried to
        the tip (`cfem.predict.rows.load_error`): it holds at 95 % of states (docs/loads.md)."""
        at = np.asarray(delta_a, float)
        modules = self._held(at)
        row, parts = self._settle(modules)
        if any(module.D is None for module in modules):
            unloaded = self._watched(*self._places([module.e[0, : self.pose] for module in modules])[::2])
            moved = float(np.linalg.norm(row.y[:3] - unloaded[:3]))
            return moved**2 / self.length + self._error_of_patches(row, parts)
        V, C = -np.tensordot(self._forces, row.H, 1), block_diag(*(part.C for part in parts))
        carried = (row.B[:3] @ np.linalg.inv(np.eye(len(V)) + C @ V)).reshape(3, len(parts), -1)
        wrenches, total = self.softer[:, None] * (self._forces @ row.B).reshape(len(parts), -1), 0.0
        for i, (module, model, w) in enumerate(zip(modules, self.modules, wrenches, strict=True)):
            extrapolation = float(model.christoffel(at[self.columns[i]]))
            errors = model.meta.get("errors", {})
            moved = parts[i].e - module.e[0]
            total += module_error(module, w, moved, carried[:, i], self._units, errors, extrapolation)
        return total + self._error_of_patches(row, parts)

    def _error_of_patches(self, row: RowKinematics, parts: list[Loaded]) -> float:
        """Estimated error, mm, as `cfem.predict.loads.loaded.wrench_error` without D, of what a patch moves its own
        module by."""
        C = block_diag(*(part.C[:, self.pose :] for part in parts))
        w = (self._forces @ row.B).reshape(len(parts), -1)[:, self.pose :].ravel()
        moved = float(np.linalg.norm(row.B[:3] @ (C @ w)))
        return moved**2 / self.length + LEFT * moved

    @property
    def _units(self) -> np.ndarray:
        """Units of the rows of a module: its length, and radians."""
        length = self.length / len(self.which)
        pose = np.repeat([length, 1.0, length], 3)[: self.pose]
        return np.concatenate([pose, np.full(3 * self._on.places, length)])

    def shape(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        """Positions (..., m, 3) mm of the surface nodes, as of the unloaded row; the modules' own surfaces to first
        order in the wrenches on their rows."""
        delta = np.asarray(delta_a, float)
        surfaces = [self._shape(state) for state in delta.reshape(-1, delta.shape[-1])]
        return np.array(surfaces).reshape(*delta.shape[:-1], *self.surface.rest.shape)

    def _shape(self, delta: np.ndarray) -> np.ndarray:
        """Positions (m, 3) mm of the surface nodes at delta (n_a,) mm."""
        row, parts = self._settle(self._held(delta))
        wrenches = (self._forces @ row.B).reshape(len(parts), -1)
        patches, rows = self._on.each, []
        modules = zip(self.surface.modules, self.columns, wrenches, self.softer, patches, strict=True)
        for skin, columns, w, softer, on in modules:
            inputs = delta[columns], np.zeros(0)
            C_es, C_ss = skin.compliance(*inputs)
            moved = w[: self.pose] @ C_es[: self.pose]
            if on:
                moved = moved + C_ss @ skin.modes_over(on) @ w[self.pose :][: 3 * len(on)]
            rows.append(skin.rows(*inputs) + softer * moved)
        P, R, _ = self._places([part.e[: self.pose] for part in parts])
        return self.surface.surface(rows, P[:-1], R)

    def surface_gradient(self, delta_a: ArrayLike, nodes: np.ndarray) -> np.ndarray:
        """Derivatives (c, 3, n_a) of `shape` at nodes (c,), by central differences."""
        delta, columns = np.asarray(delta_a, float), []
        for step in np.diag(STEP * np.abs(self.reach).max(axis=1)):
            ahead, behind = (self.shape(delta + side * step)[nodes] for side in (1, -1))
            columns.append((ahead - behind) / (2 * step.max()))
        return np.stack(columns, axis=-1)

    def _held(self, delta: np.ndarray) -> list[Held]:
        return [series.at(delta[columns]) for series, columns in zip(self._series, self.columns, strict=True)]

    def _one(self, delta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """W and delta_free at delta (n_a,) mm: the modules' compliance joined by the stiffness V of the loads that
        turn."""
        row, parts = self._settle(self._held(delta))
        V, B = -np.tensordot(self._forces, row.H, 1), row.B[: self.rows.n_e]
        C, G, K = (block_diag(*(getattr(state, name) for state in parts)) for name in "CGK")
        S = np.linalg.inv(np.eye(len(V)) + C @ V)
        part = {
            "gradient": np.concatenate([state.lam for state in parts]),
            "hessian": _symmetric(K + G.T @ V @ S @ G),
            "effector": row.y[: self.rows.n_e] - self.rest_e,
            "effector_gradient": B @ S @ G,
            "effector_compliance": _symmetric(B @ S @ C @ B.T),
        }
        return condense("displacement", self.rows, delta, part, self._sizes)

    @property
    def _sizes(self) -> np.ndarray | None:
        """Sizes (n_e,) of the modules' ends and centres of mass, None where a model has none."""
        if any(model.sizes is None for model in self.models):
            return None
        rows = [0, 1, 2, 6, 7, 8][: self.rows.n_e]
        return np.max([model.sizes[rows] for model in self.models], axis=0)

    def _settle(self, modules: list[Held]) -> tuple[RowKinematics, list[Loaded]]:
        """The row in equilibrium, from the poses of its unloaded modules."""
        e = np.array([module.e[0] for module in modules])
        for _ in range(ITERATIONS):
            row = row_of(e, self._all_rests, self.shares if self.heavy else None, self._on.places)
            w = (self._forces @ row.B).reshape(e.shape)
            parts = [self._under(*each) for each in zip(modules, w, self.softer, strict=True)]
            V = -np.tensordot(self._forces, row.H, 1)
            residual = (np.array([part.e for part in parts]) - e).ravel()
            C = block_diag(*(part.C for part in parts))
            step = np.linalg.solve(np.eye(len(residual)) + C @ V, residual)
            step = step.reshape(e.shape)
            e = e + step
            if np.abs(step / self._units).max() <= TOLERANCE:
                self._demand_far(parts)
                return row, parts
            if not np.abs(e / self._units).max() < FARTHEST:
                break
        raise NumericalError("modules in a row find no equilibrium under these loads", do="take smaller loads")

    @staticmethod
    def _demand_far(parts: list[Loaded]) -> None:
        worst = max(part.ratio for part in parts)
        if worst > NEAR:
            what = "a module in the row is too near to buckling under these loads for what it knows of them"
            raise NumericalError(what, do="take smaller loads")

    @staticmethod
    def _under(module, w: np.ndarray, softer: float) -> Loaded:
        """State of a module `softer` times as compliant as the one that was sampled: W ~ 1/E is exact."""
        state = module.under(softer * w)
        return replace(state, lam=state.lam / softer, K=state.K / softer, C=state.C * softer)


def _symmetric(M: np.ndarray) -> np.ndarray:
    return (M + M.T) / 2
