"""A learned robot whose surface may be touched at points: what its contact needs, whatever is known of the points.

The places of the points follow from the modes u_k of the skin (`cfem.predict.series.skin`) and from forces on them. How
forces on the modes change the compliance is known by finite elements at a few states, and a polynomial in delta_a
between them. How the points themselves yield, subclasses say: of patches (`cfem.predict.contact.surface.patched_model`)
or of the nodes of the mesh (`cfem.predict.contact.surface.node_model`)."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from typing import Any, NamedTuple

import numpy as np

from cfem.condensed.packing import packed_indices
from cfem.condensed.patches import Patches
from cfem.contact.detection import regions, spacings
from cfem.contact.touching_facets import Facets
from cfem.core.errors import InputError
from cfem.equilibrium.contact.node_compliance import NodeResponse
from cfem.equilibrium.contact.patch_compliance import PatchResponse
from cfem.mechanics.surface_turns import members_of, rotations, spread
from cfem.predict.loads.wrench_series import WrenchSeries
from cfem.predict.protocol import Predictor
from cfem.predict.series.chebyshev import Basis, basis
from cfem.predict.series.few_states import degrees

STILL = 1e-9  # of the largest compliance: a patch that is held has less
BENT = 0.005  # of all that is known of how loads on the modes change the compliance: what is left out
NONE = np.zeros(0)
DRAWS = 64  # random forces


class JointDents(NamedTuple):
    """Dents of c nodes.

    triples (t, 3): nodes i <= j <= k, each triple once
    change (t, 3, 3, 3) mm/N^2: of the compliance of i and j with a force on k"""

    triples: np.ndarray
    change: np.ndarray


# U, local, total, dents and tip of `PointCompliance`, and dents of points that dent together
ComplianceParts = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, JointDents | None]


@dataclass(frozen=True)
class SurfaceModel(ABC):
    """A model with a skin, the points by which it touches, each the mean of a patch, and their response by finite
    elements. InputError where the model has another form.

    most: points that may touch obstacles at once"""

    model: Predictor
    patches: Patches
    by_fe: PatchResponse | NodeResponse
    most = 30

    def __post_init__(self) -> None:
        if self.model.form != "displacement" or self.model.parameters:
            raise InputError("contact anywhere needs a model of form displacement without parameters")

    @property
    @abstractmethod
    def flexibility(self) -> np.ndarray:
        """(N, 3) mm/N: compliance of the points along the axes, the mean of all states."""

    @property
    @abstractmethod
    def local_tip(self) -> np.ndarray:
        """(terms, n_e, N, 3) mm/N, series of what the modes leave of the effectors' compliance, seen in the points."""

    @abstractmethod
    def compliance(self, points: np.ndarray, rows: np.ndarray, C_ss: np.ndarray, basis: np.ndarray) -> ComplianceParts:
        """`ComplianceParts` of points (c,), where the skin's rows are (k,) mm; C_ss (k, k) mm/N of the modes; basis
        (terms,): of the series of what is local."""

    @property
    def whole(self) -> "SurfaceModel":
        """Model of all points: this one, where a `SurfacePart` has another."""
        return self

    @cached_property
    def kept(self) -> dict[tuple[bytes, bytes | None], Any]:
        """Held robots that `held_robot.held` keeps of this model."""
        return {}

    @cached_property
    def numbers(self) -> np.ndarray:
        """(N,) of the points among all of the surface."""
        return np.arange(len(self.patches))

    @cached_property
    def U(self) -> np.ndarray:
        """(N, 3, k) the modes, means over patches."""
        return self.patches.mean(np.moveaxis(self.model.skin.modes, 0, -1))

    @cached_property
    def flat(self) -> np.ndarray:
        """(3 N, k) the same."""
        return self.U.reshape(-1, self.U.shape[-1])

    @cached_property
    def size(self) -> float:
        """mm from the origin to the farthest point at rest."""
        return float(np.linalg.norm(self.patches.rest, axis=1).max())

    @cached_property
    def moved_by_row(self) -> np.ndarray:
        """(k,) mm of the farthest point by a mm of each row."""
        return np.linalg.norm(self.U, axis=1).max(axis=0)

    @cached_property
    def moved_by_wrench(self) -> np.ndarray:
        """(n_e,) mm/N: at most so far a wrench on each effector moves a point beside the rows, in the sampled box."""
        return np.linalg.norm(self.local_tip, axis=3).max(axis=2).sum(axis=0)

    @cached_property
    def wrenches(self) -> WrenchSeries:
        """The model under any wrench on its effectors."""
        return WrenchSeries(self.model, self.model.rows.n_e)

    @cached_property
    def bent_by_wrench(self) -> np.ndarray:
        """(terms, k, n_e, n_e + k) mm/N^2, series of how the compliance between effectors and rows, and of the rows,
        changes with a wrench on the effectors: the second and third axis are of rows and effectors that bear loads."""
        n_e = self.model.rows.n_e
        bent = np.array(self.by_fe.bent[:, :, :n_e], float)
        bent[..., n_e:] = (bent[..., n_e:] + bent[..., n_e:].swapaxes(1, 3)) / 2
        return np.tensordot(self._inverse, bent, axes=1)

    @cached_property
    def held_still(self) -> np.ndarray:
        """(N,) bool: points that no force moves, as the body is held there. They touch nothing."""
        largest = self.flexibility.max(axis=1)
        return largest <= STILL * largest.max()

    @cached_property
    def facets(self) -> Facets:
        """Triangles of the points, none where these are no nodes (`cfem.contact.between_nodes`)."""
        return Facets.none(len(self.patches))

    @cached_property
    def spread(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 3, 3) and (k, N, 3, 3): `cfem.mechanics.surface_turns.spread` of the nodes of each patch and of its
        triangles, at rest and by each row of the skin."""
        skin = self.model.skin
        members = members_of(skin.triangles, self.patches.of, len(self.patches))
        by_row = np.stack([spread(members, skin.rest, mode) for mode in skin.modes])
        return spread(members, skin.rest, skin.rest), by_row

    def tip(self, points: np.ndarray, R: np.ndarray, basis: np.ndarray) -> np.ndarray:
        """(n_e, c, 3) mm/N: what the modes leave of the effectors' compliance to forces on points (c,), turned by R (c,
        3, 3). basis (terms,): of its series."""
        series = self.local_tip[:, :, points].reshape(len(basis), -1)
        return (R @ (basis @ series).reshape(-1, len(points), 3, 1))[..., 0]

    def turns(self, rows: np.ndarray, patches: np.ndarray) -> np.ndarray:
        """(c, 3, 3) rotations of patches (c,) since rest, rows (k,) mm of the skin."""
        return rotations(self.spread[0][patches] + self._spread_by_row[patches] @ rows)

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
        (i, j, k), (first, second) = packed_indices(self.bends.shape[1], 3), packed_indices(self.bends.shape[1])
        seen, mixtures = np.split(self._bent, [self.model.rows.n_e], axis=2)
        seen = seen[:, first, :, second].transpose(1, 2, 0).reshape(len(mixtures), -1)
        return (self._inverse @ np.hstack([mixtures[:, i, j, k], seen])).astype(np.float32).astype(float)

    @cached_property
    def bent_at(self) -> np.ndarray:
        """(r, n_e + r, r): which number of `bent` says how the compliance of the second and third changes with a load
        on the first."""
        r, n_e = self.bends.shape[1], self.model.rows.n_e
        cube, square = packed_indices(r, 3), packed_indices(r)
        mixtures, seen = np.empty((r, r, r), dtype=np.int64), np.empty((r, r), dtype=np.int64)
        for order in permutations(range(3)):
            mixtures[tuple(cube[list(order)])] = np.arange(cube.shape[1])
        seen[tuple(square)] = seen[tuple(square[::-1])] = np.arange(square.shape[1])
        apart = cube.shape[1] + square.shape[1] * np.arange(n_e)
        return np.concatenate([seen[:, None] + apart[:, None], mixtures], axis=1)

    @cached_property
    def cubic(self) -> tuple[np.ndarray, np.ndarray]:
        """Series of bent[v, v, v], v loads on the mixtures, a symmetric cubic form: coefficients (terms, c) mm/N^2 of
        three mixtures i <= j <= k each, and derivatives (n_a, terms, terms) 1/mm of the series by delta_a."""
        from cfem.predict.series.derivatives import input_derivatives

        low, high = self.model.domain.delta_a
        i, j, k = packed_indices(self.bends.shape[1], 3)
        orders = np.where((i == j) & (j == k), 1.0, np.where((i == j) | (j == k), 3.0, 6.0))
        by_delta = input_derivatives(self.degrees, np.diag(2 / (high - low)), len(low))
        slopes = np.stack([slope.toarray() for slope in by_delta])
        return orders * self.bent[:, : len(i)], slopes

    @cached_property
    def _of_modes(self) -> tuple[np.ndarray, np.ndarray]:
        """(J, k, n_e, k) and (J, k, k, k) mm/N^2 by finite elements: how loads on the modes change the compliance of
        the effectors and of the rows."""
        seen, modes = np.split(self.by_fe.bent[..., self.model.rows.n_e :], [self.model.rows.n_e], axis=2)
        modes = sum(modes.transpose(0, *order) for order in permutations((1, 2, 3))) / 6
        return (seen + seen.transpose(0, 3, 2, 1)) / 2, modes

    @cached_property
    def missing(self) -> float:
        """Share of the second order that the skin's modes miss: the largest of the states of finite elements.

        It is measured by forces on the effectors, whose second order finite elements know: the motion along random
        forces, over the second order of the rows as a share of the first."""
        n_e, shares, skin = self.model.rows.n_e, [], self.model.skin
        forces = np.random.default_rng(0).standard_normal((DRAWS, n_e))
        for delta, bent in zip(self.by_fe.states, self.by_fe.bent, strict=True):
            C_es, C = skin.compliance(delta, NONE)
            loads = forces @ C_es @ np.linalg.pinv(C)
            exact = np.einsum("gs,sef,ge,gf->g", loads, bent[:, :n_e, :n_e], forces, forces, optimize=True)
            first, second = loads @ C, np.einsum("gs,stu,gu->gt", loads, bent[:, n_e:, n_e:], loads, optimize=True)
            left = exact - (second * loads).sum(axis=1)
            sizes = np.linalg.norm(second, axis=1) / np.linalg.norm(first, axis=1)
            known = np.linalg.norm((first * loads).sum(axis=1) * sizes)
            shares.append(np.linalg.norm(left) / known if known > 0 else 0.0)
        return float(max(shares))

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
    def regions(self) -> tuple[np.ndarray, np.ndarray]:
        return regions(self.model.skin.rest, self.model.skin.triangles, self.patches)

    @cached_property
    def spacings(self) -> np.ndarray:
        return spacings(self.model.skin.rest, self.model.skin.triangles, self.patches)

    def in_box(self, delta: np.ndarray) -> np.ndarray:
        low, high = self.model.domain.delta_a
        return 2 * (delta - low) / (high - low) - 1
