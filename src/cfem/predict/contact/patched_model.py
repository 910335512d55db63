"""A learned robot whose surface is cut into patches, and their compliance.

Patches p of the skin are where it may be touched. Their places follow from the modes u_k of the skin
(`cfem.predict.skin`) and from the forces f_p on them, which work on the modes by w_k = sum_p u_kp . f_p:

    x_p = X_p + sum_k u_kp s_k + sum_q R_p L_pq R_q^T f_q + R_p E_p[g_p, g_p] / 2        g_p = R_p^T f_p
    s = s_0 + C_ss w        e = e_0 + C_es w + sum_p (T_p g_p + F_p[g_p, g_p] / 2)

s_0, e_0 and the compliances C are the model's at delta_a. L_pq is what the modes leave of the compliance between two
patches. It is local: it falls with their distance and turns with them, by R_p, the rotation of a patch since rest that
fits its nodes best (Kabsch, 1976). E_p is how a force on patch p changes its own part L_pp: a body that is dented
stiffens. T_p and F_p are the same between a patch and the effectors. Seen in the patches all these change little:
polynomials in delta_a of degree three, less where that has many terms, through finite elements at as few states."""

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement, permutations

import numpy as np
from scipy.linalg import qr

from cfem.condensed.packing import symmetric3_indices
from cfem.condensed.patches import Patches, cut
from cfem.contact.detection import along
from cfem.core.errors import InputError, SpecError
from cfem.equilibrium.contact.patch_compliance import PatchResponse
from cfem.predict.chebyshev import Basis, basis
from cfem.predict.domain import Domain
from cfem.predict.protocol import Predictor

STILL = 1e-9  # of the largest compliance: a patch that is held has less
BENT = 0.005  # of all that is known of how loads on the modes change the compliance: what is left out
TERMS, MOST = 10, 3  # of the polynomials through these, and their highest degree
NONE = np.zeros(0)
COARSEST = 0.5  # of the length: patches farther apart are no surface


@dataclass(frozen=True)
class PatchedModel:
    """A model with a skin, its patches, and how they yield by finite elements
    (`cfem.equilibrium.contact.patch_compliance`); `patch_states` says where."""

    model: Predictor
    patches: Patches
    by_fe: PatchResponse

    def __post_init__(self) -> None:
        if self.model.form != "displacement" or self.model.parameters:
            raise InputError("contact anywhere needs a model of form displacement without parameters")
        J, n, compliance = len(self.by_fe.states), 3 * len(self.patches), self.by_fe.own
        if compliance.shape != (J, n, n) or not np.isfinite(compliance).all():
            raise InputError(f"expected the finite compliance of {n // 3} patches at {J} states")

    @cached_property
    def U(self) -> np.ndarray:
        """(N, 3, k) the modes, means over patches."""
        return self.patches.mean(np.moveaxis(self.model.skin.modes, 0, -1))

    @cached_property
    def flat(self) -> np.ndarray:
        """(3 N, k) the same."""
        return self.U.reshape(-1, self.U.shape[-1])

    @cached_property
    def held_still(self) -> np.ndarray:
        """(N,) bool: patches that no force moves, as the body is held there. They touch nothing."""
        flexibility = np.diagonal(self.by_fe.own, axis1=1, axis2=2).mean(axis=0).reshape(-1, 3).max(axis=1)
        return flexibility <= STILL * flexibility.max()

    @cached_property
    def spread(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3, 3) and (k, N, 3, 3): sum of (x - mean x) (X - mean X)^T over the nodes of each patch and of its
        triangles, at rest and by each row of the skin."""
        skin, patch = self.model.skin, self.patches.of
        rest, by_row = np.zeros((len(self.patches), 3, 3)), np.zeros((len(skin), len(self.patches), 3, 3))
        corners = patch[skin.triangles]
        for number in range(len(self.patches)):
            nodes = np.unique(skin.triangles[(corners == number).any(axis=1)])
            X = skin.rest[nodes] - skin.rest[nodes].mean(axis=0)
            rest[number] = X.T @ X
            by_row[:, number] = np.einsum("kia,ib->kab", skin.modes[:, nodes], X)
        return rest, by_row

    def turns(self, rows: np.ndarray, patches: np.ndarray) -> np.ndarray:
        """(c, 3, 3) rotations of patches (c,) since rest, rows (k,) mm of the skin."""
        left, _, right = np.linalg.svd(self.spread[0][patches] + self._spread_by_row[patches] @ rows)
        left[:, :, 2] *= np.sign(np.linalg.det(left @ right))[:, None]
        return left @ right

    @cached_property
    def _spread_by_row(self) -> np.ndarray:
        """(N, 3, 3, k)"""
        return np.ascontiguousarray(np.moveaxis(self.spread[1], 0, -1))

    @cached_property
    def degrees(self) -> np.ndarray:
        """Degrees (terms, n_a) of the series of L."""
        return degrees(self.model.rows.n_a)[: len(self.by_fe.states)]

    @cached_property
    def basis(self) -> Basis:
        """Basis of the series of L, at what `in_box` gives."""
        return Basis(self.degrees)

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

    @cached_property
    def bends(self) -> np.ndarray:
        """(k, r) orthonormal mixtures of the modes: loads on others change the compliance by no more than BENT of what
        all do (De Lathauwer, De Moor and Vandewalle, *A multilinear singular value decomposition*, 2000)."""
        both = np.concatenate(self._of_modes, axis=2).swapaxes(0, 1)
        mixtures, sizes, _ = np.linalg.svd(both.reshape(len(both), -1), full_matrices=False)
        left = np.sqrt(np.cumsum(sizes[::-1] ** 2)[::-1])
        return mixtures[:, left > BENT * left[0]] if left[0] > 0 else mixtures[:, :1]

    @cached_property
    def bent(self) -> np.ndarray:
        """(terms, c) mm/N^2, series of how the compliance of effectors and of mixtures `bends` of the modes changes
        with loads on these, as symmetric as the derivatives of an energy are, and rounded like L: of i <= j <= k what
        mixtures have, and then of each effector what it has of i <= j."""
        (i, j, k), (first, second) = symmetric3_indices(self.bends.shape[1]), np.triu_indices(self.bends.shape[1])
        seen, mixtures = np.split(self._bent, [self.model.rows.n_e], axis=2)
        seen = seen[:, first, :, second].transpose(1, 2, 0).reshape(len(mixtures), -1)
        return (self._inverse @ np.hstack([mixtures[:, i, j, k], seen])).astype(np.float32).astype(float)

    @cached_property
    def bent_at(self) -> np.ndarray:
        """(r, n_e + r, r): which number of `bent` says how the compliance of the second and third changes with a load
        on the first."""
        r, n_e = self.bends.shape[1], self.model.rows.n_e
        cube, square = symmetric3_indices(r), np.array(np.triu_indices(r))
        mixtures, seen = np.empty((r, r, r), dtype=np.int64), np.empty((r, r), dtype=np.int64)
        for order in permutations(range(3)):
            mixtures[tuple(cube[list(order)])] = np.arange(cube.shape[1])
        seen[tuple(square)] = seen[tuple(square[::-1])] = np.arange(square.shape[1])
        apart = cube.shape[1] + square.shape[1] * np.arange(n_e)
        return np.concatenate([seen[:, None] + apart[:, None], mixtures], axis=1)

    @cached_property
    def cubic(self) -> tuple[np.ndarray, tuple[np.ndarray, ...], np.ndarray]:
        """Series of bent[v, v, v], v loads on the mixtures, a symmetric cubic form: coefficients (terms, c) mm/N^2, the
        three mixtures (c,) that each goes with, and derivatives (n_a, terms, terms) 1/mm of the series by delta_a."""
        from cfem.predict.series import input_derivatives

        low, high = self.model.domain.delta_a
        i, j, k = symmetric3_indices(self.bends.shape[1])
        orders = np.where((i == j) & (j == k), 1.0, np.where((i == j) | (j == k), 3.0, 6.0))
        by_delta = input_derivatives(self.degrees, np.diag(2 / (high - low)), len(low))
        slopes = np.stack([slope.toarray() for slope in by_delta])
        return orders * self.bent[:, : len(i)], (i, j, k), slopes

    @cached_property
    def _of_modes(self) -> tuple[np.ndarray, np.ndarray]:
        """(J, k, n_e, k) and (J, k, k, k) mm/N^2 by finite elements: how loads on the modes change the compliance of
        the effectors and of the rows."""
        seen, modes = np.split(self.by_fe.bent[..., self.model.rows.n_e :], [self.model.rows.n_e], axis=2)
        modes = sum(modes.transpose(0, *order) for order in permutations((1, 2, 3))) / 6
        return (seen + seen.transpose(0, 3, 2, 1)) / 2, modes

    @cached_property
    def _bent(self) -> np.ndarray:
        """(J, r, n_e + r, r) mm/N^2: `bent` at the states of finite elements."""
        Q, (seen, modes) = self.bends, self._of_modes
        seen = np.einsum("skel,ka,lb->saeb", seen, Q, Q, optimize=True)
        return np.concatenate([seen, np.einsum("sklm,ka,lb,mc->sabc", modes, Q, Q, Q, optimize=True)], axis=2)

    @cached_property
    def _inverse(self) -> np.ndarray:
        """(terms, J): series from values at the states."""
        return np.linalg.pinv(basis(self.in_box(self.by_fe.states), self.degrees))

    @cached_property
    def along(self) -> np.ndarray:
        """(N, N) mm between patches along the surface at rest."""
        return along(self.model.skin.rest, self.model.skin.triangles, self.patches)

    def in_box(self, delta: np.ndarray) -> np.ndarray:
        low, high = self.model.domain.delta_a
        return 2 * (delta - low) / (high - low) - 1


def turn_cubic(tensor: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Tensors (c, 3, 3, 3 + n_e) turned by R (c, 3, 3) each, which the effectors are not."""
    half = np.einsum("pai,pijk->pajk", R, tensor)
    half[..., :3] = half[..., :3] @ R.swapaxes(1, 2)[:, None]
    return np.einsum("pbj,pajk->pabk", R, half)


def degrees(n_a: int) -> np.ndarray:
    """(terms, n_a) degrees of the polynomial through L, the lower ones first: of the highest total degree, MOST at
    most, that has no more than TERMS."""
    rows = [np.zeros(n_a, dtype=np.int64)]
    for degree in range(1, MOST + 1):
        more = [np.bincount(axes, minlength=n_a) for axes in combinations_with_replacement(range(n_a), degree)]
        if degree > 1 and len(rows) + len(more) > TERMS:
            break
        rows += more
    return np.array(rows)


def patch_states(domain: Domain, n_a: int) -> np.ndarray:
    """(J, n_a) mm: of the training states those at which finite elements say most of a polynomial in delta_a (pivots of
    a QR factorisation: Sommariva and Vianello, *Computing approximate Fekete points*, 2009)."""
    states = domain.states[:, :n_a]
    low, high = domain.delta_a
    values = basis(2 * (states - low) / (high - low) - 1, degrees(n_a))
    chosen = qr(values.T, mode="r", pivoting=True)[1][: min(values.shape)]
    return states[np.sort(chosen)]


def patches_of(model: Predictor, apart: float | None = None, sharp_edges: bool = False) -> Patches:
    """The patches of a model's skin (`cut`), about `apart` mm from each other, a twentieth of the length unless given.
    SpecError where they are too far apart."""
    if apart is not None and apart > COARSEST * model.length:
        what = f"{apart:g} mm is too coarse for a robot that is {model.length:.3g} mm long"
        raise SpecError(what, where="patches", do=f"take about {model.length / 20:.2g} mm, or leave the key out")
    skin = model.skin
    return cut(skin.rest, skin.weights, apart or model.length / 20, skin.triangles, sharp_edges)
