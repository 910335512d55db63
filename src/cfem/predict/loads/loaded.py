"""A model under a constant load that its samples did not carry: a payload, a push, a weight in another direction.

A wrench w (n_e,) on the effectors' rows adds its work to the potential. With C the compliance of the effectors' rows at
the state (`cfem.predict.series.energy`) and D = dC/dw, symmetric in its three indices, where the samples knew it, the
loaded robot is again one of an energy:

    form displacement   Psi_w  = Psi  - w . e - w . C w / 2 - D[w, w, w] / 6     gradient: the forces that hold it there
    form force          Psi*_w = Psi* + w . e + w . C w / 2 + D[w, w, w] / 6     gradient: where the actuators then are
    both                e_w = e + C w + D[w, w] / 2                              C_w = C + D[w]

as d Psi_w / dw = -e_w (Castigliano; Washizu, *Variational Methods in Elasticity and Plasticity*, 1982, chapter 2). All
are series of one basis, so that a constant wrench is a sum of their coefficients: a loaded model costs nothing more to
evaluate, and exports as any other. What is left out of e_w is of second order in w without D, of third with it."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Rows
from cfem.condensed.packing import pack_upper, packed_indices
from cfem.constraint.patch import PatchLoad
from cfem.core.errors import InputError, SpecError
from cfem.equilibrium.contact.patch_effectors import PatchYield
from cfem.predict.array_predictor import ArrayPredictor
from cfem.predict.kinds.spectral import SpectralPredictor
from cfem.predict.loads.loaded_rows import LEFT, LoadedRows, rows_of
from cfem.predict.loads.loaded_skin import skin_under
from cfem.predict.protocol import Predictor
from cfem.predict.rows.loaded_serial import LoadedSerialPredictor
from cfem.predict.rows.serial import SerialPredictor
from cfem.predict.rows.serial_patches import row_patches
from cfem.predict.series.chebyshev import Basis
from cfem.predict.series.derivatives import differentiated
from cfem.predict.series.domain import Domain
from cfem.predict.series.energy import THIRD

TRUSTED = 0.005  # of the length: the estimated error of e_w up to which a wrench is taken
FITTED = 3e-4  # and what polynomials leave of that
FOLLOWING = 3.0  # times the estimate, which is the middle of what comes true, for patches


def wrench_of(rows: Rows, forces: Mapping[str, Sequence[float]]) -> np.ndarray:
    """Wrench (n_e,), N and N mm, on all effector rows, of forces (3,) N by the name of the effector that they act on.
    SpecError where there is no such effector."""
    wrench = np.zeros(rows.n_e)
    for name, force in forces.items():
        for axis, component in zip("xyz", force, strict=True):
            row = f"{name}.{axis}"
            if row not in rows.effectors:
                known = sorted({each.rpartition(".")[0] for each in rows.effectors})
                what = f"there is no effector {name!r} with rows x, y and z"
                raise SpecError(what, where="loads", do=f"known are {', '.join(known)}")
            wrench[rows.effectors.index(row)] += component
    return wrench


def loaded(
    model: Predictor,
    wrench: ArrayLike | None = None,
    patches: Sequence[PatchLoad] = (),
    by_fe: PatchYield | None = None,
    trusted: float = TRUSTED,
) -> Predictor:
    """The model under a wrench (n_e,) N or N mm on its effector rows, and forces on patches of its skin, at the
    reference of parameters that are exact without loads. by_fe: how the patches yield by finite elements, for which
    the effectors are known to the second order of the forces, instead of the first.

    Effectors stay relative to where they rest without load. InputError where the model is no series, has no skin for
    patches, the wrench is not finite, or so large that the estimated error (`wrench_error`) exceeds the share `trusted`
    of the robot's length; SpecError where a patch is not on the surface."""
    wrench = np.zeros(model.rows.n_e) if wrench is None else np.asarray(wrench, float)
    serial = isinstance(model, SerialPredictor)
    foreign = next((part.meta["kind"] for part in _models(model) if not isinstance(part, SpectralPredictor)), None)
    if foreign is not None:
        what = f"loads need a model of kind spectral, or of kind serial made of such, not {foreign}"
        raise InputError(what, do="train one")
    if wrench.shape != (model.rows.n_e,) or not np.isfinite(wrench).all():
        raise InputError(f"a wrench must have {model.rows.n_e} finite numbers, one for each effector row")
    if serial:
        meta = {**model.meta, "wrench": wrench.tolist()}
        under_load = LoadedSerialPredictor(meta, model.arrays, row_patches(model, patches))
        error = under_load.wrench_error()
        _demand_trusted(model.length, trusted, error, lambda share: share**2 * error)
    else:
        rows, w = rows_of(model, patches, by_fe), _all_rows(wrench, patches)
        error = _error(model, rows, w)
        _demand_trusted(model.length, trusted, error, lambda share: _error(model, rows, share * w))
        under_load = _loaded(model, rows, w)
    under_load.meta = {**under_load.meta, "wrench": wrench.tolist(), "wrench_error": error}
    if patches:
        under_load.meta["patch_loads"] = [patch.to_json() for patch in patches]
    under_load.domain = _domain(model, under_load)
    under_load.meta["domain"] = under_load.domain.to_json()
    # modules bear the wrench each for itself
    under_load.skin_source = model.skin_source if serial else lambda: skin_under(model, wrench, patches)
    return under_load


def _models(model: Predictor) -> list[Predictor]:
    return model.models if isinstance(model, SerialPredictor) else [model]


def _demand_trusted(length: float, trusted: float, error: float, of_share: Callable[[float], float]) -> None:
    """InputError where the error is larger than is trusted; it says how much of the loads would do."""
    allowed = trusted * length
    if error > allowed:
        share = np.floor(100 * np.sqrt(allowed / error)) / 100
        while share > 0 and of_share(share) > allowed:
            share -= 0.01
        at_most = f"at most {share:.0%}" if share > 0.005 else "less than 1%"
        raise InputError(
            f"the loads move the effectors so far that the model would be wrong by about {error:.2g} mm, "
            f"and {allowed:.2g} mm are allowed ({100 * trusted:g} % of the length)",
            do=f"take {at_most} of them, or give them to the scene and sample it",
        )


def wrench_error(
    model: SpectralPredictor,
    wrench: np.ndarray,
    patches: Sequence[PatchLoad] = (),
    by_fe: PatchYield | None = None,
) -> float:
    """Estimated error, mm, of the loaded model, where that is worst among the training states. Without D: a slender
    body that a force moves by d is stiffer or softer after it by a share of about d over its length, d^2 / length. With
    D: the terms of e_w fall like a geometric series, so that the first left out is the square of the last over the one
    before. Of patches, a share of what they move the effectors by comes on top: LEFT by the modes of the skin, FITTED
    by finite elements."""
    return _error(model, rows_of(model, patches, by_fe), _all_rows(wrench, patches))


def _error(model: SpectralPredictor, rows: LoadedRows, w: np.ndarray) -> float:
    """Estimated error, mm: the order that follows the last one known, and what patches leave (`wrench_error`)."""
    basis, n_e = _basis_of_states(model, rows.indices), model.rows.n_e
    C = np.tensordot(basis, rows.C, 1)
    first = _farthest(C @ w, rows.moves)
    by_patches = (C[:, :n_e, n_e:] @ w[n_e:])[:, rows.moves[0, :n_e]]
    left = (FITTED if rows.second else LEFT) * np.linalg.norm(by_patches, axis=1)
    if not rows.second:
        return float((first**2 / model.length + left).max())
    second = _farthest(np.tensordot(basis, rows.D @ w @ w / 2, 1), rows.moves)
    following = second**2 / np.where(first > 0, first, 1.0)
    return float(((FOLLOWING if len(w) > n_e else 1.0) * following + left).max())


def _farthest(moved: np.ndarray, moves: np.ndarray) -> np.ndarray:
    """Distances (m,) mm of rows moved (m, r), of that effector or patch which moves farthest; moves (g, r)."""
    return np.sqrt((moved**2) @ moves.T).max(axis=1)


def _all_rows(wrench: np.ndarray, patches: Sequence[PatchLoad]) -> np.ndarray:
    return np.concatenate([wrench, *(patch.force for patch in patches)])


def _loaded(model: SpectralPredictor, rows: LoadedRows, w: np.ndarray) -> SpectralPredictor:
    """Model under w (r,) N on all rows."""
    n_e = model.rows.n_e
    C, moved = rows.C, rows.C @ w  # (M, r)
    work = (rows.e + moved / 2) @ w[:, None]
    if rows.D is not None:
        stiffened = rows.D @ w  # (M, r, r)
        work += (stiffened @ w) @ w[:, None] / 6
        C, moved = C + stiffened, moved + stiffened @ w / 2
    psi = rows.psi + work if model.form == "force" else rows.psi - work
    e, packed = (rows.e + moved)[:, :n_e], pack_upper(C[:, :n_e, :n_e])
    series = differentiated(rows.indices, model.arrays["to_box"], model.rows.n_a, psi, e, packed)
    arrays = {**model.arrays, "series": series}
    if len(w) > n_e:
        arrays = {**arrays, "indices": rows.indices.astype(model.arrays["indices"].dtype)}
        arrays.pop(THIRD, None)
        if rows.D is not None:
            arrays[THIRD] = rows.D[:, *packed_indices(n_e, 3)].T.copy()
    parameters = [parameter for parameter in model.meta["parameters"] if not parameter["exact"]]
    return SpectralPredictor({**model.meta, "parameters": parameters}, arrays)


def _domain(model: Predictor, under_load: Predictor) -> Domain:
    """Domain of the loaded model: the trained states moved by what the wrench changes: the forces at the same
    displacements, or the displacements under the same forces."""
    old, n_a, by_displacement = model.domain, model.rows.n_a, model.form == "displacement"
    s = old.states[:, :n_a] if by_displacement else old.states[:, n_a : 2 * n_a]
    change = np.array(
        [
            _dual(under_load, inputs, q) - _dual(model, inputs, q)
            for inputs, q in zip(s, old.states[:, 2 * n_a :], strict=True)
        ]
    )
    lowest, highest = change.min(axis=0), change.max(axis=0)
    states, boxes = old.states.copy(), {"delta_a": old.delta_a, "lambda_a": old.lambda_a}
    dual = "lambda_a" if by_displacement else "delta_a"
    boxes[dual] = np.stack([boxes[dual][0] + lowest, boxes[dual][1] + highest])
    first = n_a if by_displacement else 0
    states[:, first : first + n_a] += change
    return Domain(boxes["delta_a"], boxes["lambda_a"], old.p, states)


def _dual(model: ArrayPredictor, s: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Duals (n_a,): forces at displacements s, or displacements under forces s."""
    W, free = model.learned(s, q)
    a = model.rows.a
    return np.linalg.solve(W[a, a], s - free[a]) if model.form == "displacement" else W[a, a] @ s + free[a]


def _basis_of_states(model: SpectralPredictor, indices: np.ndarray) -> np.ndarray:
    """Basis (k, M) at the training states that the domain keeps."""
    n_a, states = model.rows.n_a, model.domain.states
    s = states[:, :n_a] if model.form == "displacement" else states[:, n_a : 2 * n_a]
    return Basis(indices)(model.box(np.hstack([s, states[:, 2 * n_a :]])))
