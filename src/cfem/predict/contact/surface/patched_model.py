"""A learned robot whose surface is cut into patches, and their compliance.

Patches p of the skin are where it may be touched. Their places follow from the modes u_k of the skin
(`cfem.predict.series.skin`) and from the forces f_p on them, which work on the modes by w_k = sum_p u_kp . f_p:

    x_p = X_p + sum_k u_kp s_k + sum_q R_p L_pq R_q^T f_q + R_p E_p[g_p, g_p] / 2        g_p = R_p^T f_p
    s = s_0 + C_ss w        e = e_0 + C_es w + sum_p (T_p g_p + F_p[g_p, g_p] / 2)

s_0, e_0 and the compliances C are the model's at delta_a. L_pq is what the modes leave of the compliance between two
patches. It is local: it falls with their distance and turns with them, by R_p, the rotation of a patch since rest that
fits its nodes best (Kabsch, 1976). E_p is how a force on patch p changes its own part L_pp: a body that is dented
stiffens. T_p and F_p are the same between a patch and the effectors. Seen in the patches all these change little:
polynomials in delta_a of degree three, less where that has many terms, through finite elements at as few states."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.condensed.patches import Patches, cut
from cfem.core.errors import InputError, SpecError
from cfem.equilibrium.contact.patch_compliance import PatchResponse
from cfem.predict.contact.surface.patch_compliance import patch_compliance
from cfem.predict.contact.surface.surface_model import NONE, ComplianceParts, SurfaceModel
from cfem.predict.protocol import Predictor

COARSEST = 0.5  # of the length: patches farther apart are no surface


@dataclass(frozen=True)
class PatchedModel(SurfaceModel):
    """A model with a skin, its patches, and how they yield by finite elements
    (`cfem.equilibrium.contact.patch_compliance`); `patch_states` says where."""

    by_fe: PatchResponse

    def __post_init__(self) -> None:
        super().__post_init__()
        J, n, compliance = len(self.by_fe.states), 3 * len(self.patches), self.by_fe.own
        if compliance.shape != (J, n, n) or not np.isfinite(compliance).all():
            raise InputError(f"expected the finite compliance of {n // 3} patches at {J} states")

    @cached_property
    def flexibility(self) -> np.ndarray:
        return np.diagonal(self.by_fe.own, axis1=1, axis2=2).mean(axis=0).reshape(-1, 3)

    def compliance(self, points: np.ndarray, rows: np.ndarray, C_ss: np.ndarray, basis: np.ndarray) -> ComplianceParts:
        R = self.turns(rows, points)
        parts = patch_compliance(points, self.U, C_ss, R, basis, self.local, self.dented)
        return *parts, self.tip(points, R, basis), None

    @cached_property
    def local(self) -> np.ndarray:
        """(N, N, terms, 3, 3) mm/N, series of L, rounded to single precision, as C has them: far below their error."""
        return np.ascontiguousarray(np.moveaxis(self._left[0], 0, 2)).astype(np.float32).astype(float)

    @cached_property
    def local_tip(self) -> np.ndarray:
        """(terms, n_e, N, 3) mm/N, series of what the modes leave of the effectors' compliance, seen in the patches."""
        return self._left[1]

    @cached_property
    def dented(self) -> np.ndarray:
        """(terms, N, 3, 3, 3 + n_e) mm/N^2, series of E and F: what modes leave of how the compliance of each patch,
        with itself and with the effectors, changes with a force on it; symmetric, and rounded like L."""
        model, N, left, n_e = self.model, len(self.patches), [], self.model.rows.n_e
        V = self.U @ self.bends
        for delta, bent, dented in zip(self.by_fe.states, self._bent, self.by_fe.dented, strict=True):
            by_modes = np.einsum("pai,pbj,irj->pabr", V, V, bent, optimize=True)
            by_modes = np.concatenate([by_modes[..., n_e:] @ V.swapaxes(1, 2)[:, None], by_modes[..., :n_e]], 3)
            R = self.turns(model.skin.rows(delta, NONE), np.arange(N))
            left.append(turn_cubic(dented - by_modes, R.swapaxes(1, 2)))
        return np.tensordot(self._inverse, np.stack(left), axes=1).astype(np.float32).astype(float)

    @cached_property
    def _left(self) -> tuple[np.ndarray, np.ndarray]:
        """Series of L (terms, N, N, 3, 3) and of the effectors' part (terms, n_e, N, 3): compliance by finite elements
        less that of the modes, in frames that turn with the patches."""
        model, N, J = self.model, len(self.patches), len(self.by_fe.states)
        left, tip = np.empty((J, N, N, 3, 3)), np.empty((J, model.rows.n_e, N, 3))
        for j, (delta, compliance, to_tip) in enumerate(
            zip(self.by_fe.states, self.by_fe.own, self.by_fe.tip, strict=True)
        ):
            C_es, C = model.skin.compliance(delta, NONE)
            apart = (compliance - self.flat @ C @ self.flat.T).reshape(N, 3, N, 3).swapaxes(1, 2)
            R = self.turns(model.skin.rows(delta, NONE), np.arange(N))
            left[j] = np.einsum("pba,pqbc,qcd->pqad", R, apart, R, optimize=True)
            tip[j] = ((to_tip - C_es @ self.flat.T).reshape(-1, N, 1, 3) @ R)[:, :, 0]
        series = np.tensordot(self._inverse, left, axes=1)
        return (series + series.transpose(0, 2, 1, 4, 3)) / 2, np.tensordot(self._inverse, tip, axes=1)


def turn_cubic(tensor: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Tensors (c, 3, 3, 3 + n_e) turned by R (c, 3, 3) each, which the effectors are not."""
    half = np.einsum("pai,pijk->pajk", R, tensor)
    half[..., :3] = half[..., :3] @ R.swapaxes(1, 2)[:, None]
    return np.einsum("pbj,pajk->pabk", R, half)


def patches_of(model: Predictor, apart: float | None = None, sharp_edges: bool = False) -> Patches:
    """The patches of a model's skin (`cut`), about `apart` mm from each other, a twentieth of the length unless given.
    SpecError where they are too far apart."""
    if apart is not None and apart > COARSEST * model.length:
        what = f"{apart:g} mm is too coarse for a robot that is {model.length:.3g} mm long"
        raise SpecError(what, where="patches", do=f"take about {model.length / 20:.2g} mm, or leave the key out")
    skin = model.skin
    return cut(skin.rest, skin.weights, apart or model.length / 20, skin.triangles, sharp_edges)
