"""What a constant wrench works on: the effectors' rows, and the places x, y, z of patches of the skin.

A force f on a patch works on the modes u_k of the skin by w_k = U_k . f, U_k their mean over the patch
(`cfem.constraint.patch`). So the patch is one more effector, of displacement U^T s and of the compliances C_es U and
U^T C_ss U: series of the union of the model's basis and the skin's. What the modes leave of the compliance is missing,
and so is D. Finite elements at a few states (`cfem.equilibrium.contact.patch_effectors`) tell both, as polynomials in
delta_a of degree three, less where that has many terms."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cfem.condensed.packing import unpacking
from cfem.constraint.patch import PatchLoad
from cfem.core.errors import InputError
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.series.chebyshev import basis, union
from cfem.predict.series.energy import THIRD, layout
from cfem.predict.series.few_states import degrees

if TYPE_CHECKING:
    from cfem.equilibrium.contact.patch_effectors import PatchYield

LEFT = 0.08  # of what forces on patches move the effectors by: what the modes of the skin leave of it


@dataclass(frozen=True)
class LoadedRows:
    """Series of the rows that a wrench works on, in the basis indices (M, n).

    psi: (M, 1) of the potential
    e, C: (M, r) and (M, r, r) of the rows
    D: of four axes, dC/dw where it is known
    second: whether D is known of all rows, as it is 0 where it is not
    moves: (g, r) bool, rows of each effector, or patch, that are displacements"""

    indices: np.ndarray
    psi: np.ndarray
    e: np.ndarray
    C: np.ndarray
    D: np.ndarray | None
    second: bool
    moves: np.ndarray


def rows_of(
    model: SpectralPredictor, patches: Sequence[PatchLoad] = (), by_fe: "PatchYield | None" = None
) -> LoadedRows:
    """Rows of the effectors, then of the patches; by_fe: how these yield by finite elements. InputError where the model
    has no skin, or one of another geometry; SpecError where a patch is not on it."""
    parts, series = layout(model.rows.n_a, model.rows.n_e), model.arrays["series"]
    psi, e, C = (series[parts[name]].T for name in ("energy", "effector", "effector_compliance"))
    third = model.arrays.get(THIRD)
    D = None if third is None else third.T[:, unpacking(model.rows.n_e, 3)]
    moves = np.array([[unit == "mm" for unit, _ in model.rows.effector_units]])
    effectors = LoadedRows(model.arrays["indices"], psi, e, C[:, unpacking(model.rows.n_e)], D, D is not None, moves)
    if not patches:
        return effectors
    rows = _with_patches(model, effectors, patches)
    return rows if by_fe is None else _corrected(model, rows, by_fe)


def _corrected(model: SpectralPredictor, rows: LoadedRows, by_fe: "PatchYield") -> LoadedRows:
    """Rows with what finite elements say of the patches, to the second order of the forces."""
    n_e, terms = model.rows.n_e, degrees(model.rows.n_a)[: len(by_fe.states)]
    z = model.box(by_fe.states)
    inverse, known = np.linalg.pinv(basis(z, terms)), basis(z, rows.indices)
    indices, (old, new) = union(rows.indices, terms)
    psi, e, C = (np.zeros((len(indices), *series.shape[1:])) for series in (rows.psi, rows.e, rows.C))
    psi[old], e[old], C[old] = rows.psi, rows.e, rows.C
    e[new, n_e:] += inverse @ (by_fe.e - (known @ rows.e)[:, n_e:])
    left = by_fe.C - np.tensordot(known, rows.C, 1)
    left[:, :n_e, :n_e] = 0.0  # which the model knows better
    C[new] += np.tensordot(inverse, left, 1)
    D = np.zeros((len(indices), *by_fe.D.shape[1:]))
    D[new] = np.tensordot(inverse, by_fe.D, 1)
    if rows.D is not None:  # of the effectors, which the model knows better
        D[:, :n_e, :n_e, :n_e] = 0.0
        D[old] += rows.D
    return LoadedRows(indices, psi, e, C, D, True, rows.moves)


def _with_patches(model: SpectralPredictor, effectors: LoadedRows, patches: Sequence[PatchLoad]) -> LoadedRows:
    """Rows of the effectors, then those of patches by the modes of the skin, to the first order of the forces."""
    changing = next((parameter.name for parameter in model.parameters if parameter.moves_body), None)
    if changing:
        what = f"the surface of other designs is not known: '{changing}' changes where it rests"
        raise InputError(what, where=f"loads.{patches[0].name}", do="train a model without this parameter")
    U, skin, n_e = model.skin.modes_over(patches), model.skin.arrays, model.rows.n_e
    k, r = len(U), n_e + U.shape[1]
    if not all(np.array_equal(skin[name], model.arrays[name]) for name in ("to_box", "offset")):
        raise InputError("the skin is of another model", do="train the model again")
    C_es, C_ss = np.split(skin["compliance"].T, [n_e * k], axis=1)
    indices, (a, b, c) = union(effectors.indices, skin["indices"], skin["compliance_indices"])
    psi, e, C = np.zeros((len(indices), 1)), np.zeros((len(indices), r)), np.zeros((len(indices), r, r))
    psi[a], e[a, :n_e], C[a, :n_e, :n_e] = effectors.psi, effectors.e, effectors.C
    e[b, n_e:] = skin["series"].T @ U
    C[c, :n_e, n_e:] = C_es.reshape(-1, n_e, k) @ U
    C[:, n_e:, :n_e] = C[:, :n_e, n_e:].swapaxes(1, 2)
    C[c, n_e:, n_e:] = U.T @ C_ss[:, unpacking(k)] @ U
    each = np.repeat(np.eye(len(patches), dtype=bool), 3, axis=1)
    moves = np.block([[effectors.moves, np.zeros((1, r - n_e), bool)], [np.zeros((len(patches), n_e), bool), each]])
    D = None
    if effectors.D is not None:
        D = np.zeros((len(indices), r, r, r))
        D[a, :n_e, :n_e, :n_e] = effectors.D
    return LoadedRows(indices, psi, e, C, D, False, moves)
