"""A model under a constant load that its samples did not carry: a payload, a push, a weight in another direction.

A wrench w (n_e,) on the effectors' rows adds its work to the potential. With C the compliance of the effectors' rows at
the state (`cfem.predict.energy`) and D = dC/dw, symmetric in its three indices, where the samples knew it, the loaded
robot is again one of an energy:

    form displacement   Psi_w  = Psi  - w . e - w . C w / 2 - D[w, w, w] / 6     gradient: the forces that hold it there
    form force          Psi*_w = Psi* + w . e + w . C w / 2 + D[w, w, w] / 6     gradient: where the actuators then are
    both                e_w = e + C w + D[w, w] / 2                              C_w = C + D[w]

as d Psi_w / dw = -e_w (Castigliano; Washizu, *Variational Methods in Elasticity and Plasticity*, 1982, chapter 2). All
are series of one basis, so that a constant wrench is a sum of their coefficients: a loaded model costs nothing more to
evaluate, and exports as any other. What is left out of e_w is of second order in w without D, of third with it."""

from collections.abc import Mapping, Sequence

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.packing import pack_upper
from cfem.core.errors import InputError, SpecError
from cfem.predict.domain import Domain
from cfem.predict.energy import THIRD, layout, unpacking, unpacking3
from cfem.predict.loaded_serial import LoadedSerialPredictor
from cfem.predict.loaded_skin import skin_under
from cfem.predict.protocol import ArrayPredictor, Predictor
from cfem.predict.serial import SerialPredictor
from cfem.predict.series import differentiated
from cfem.predict.spectral import SpectralPredictor

TRUSTED = 0.005  # of the length: the estimated error of e_w up to which a wrench is taken


def wrench_of(rows: Rows, forces: Mapping[str, Sequence[float]]) -> np.ndarray:
    """(n_e,) N and N mm on all effector rows, of forces (3,) N by the name of the effector that they act on.
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


def loaded(model: Predictor, wrench: np.ndarray) -> Predictor:
    """The model under a wrench (n_e,) N or N mm on its effector rows, at the reference of parameters that are exact
    without loads.

    Effectors stay relative to where they rest without load. InputError where the model is no series, the wrench is not
    finite, or so large that the estimated error (`wrench_error`) exceeds half a percent of the robot's length."""
    wrench = np.asarray(wrench, float)
    models = model.models if isinstance(model, SerialPredictor) else [model]
    other = next((one.meta["kind"] for one in models if not isinstance(one, SpectralPredictor)), None)
    if other is not None:
        what = f"loads need a model of kind spectral, or of kind serial made of such, not {other}"
        raise InputError(what, do="train one")
    if wrench.shape != (model.rows.n_e,) or not np.isfinite(wrench).all():
        raise InputError(f"a wrench has {model.rows.n_e} finite numbers, one for each effector row")
    if isinstance(model, SerialPredictor):
        found = LoadedSerialPredictor({**model.meta, "wrench": wrench.tolist()}, model.arrays)
        error = found.error()
    else:
        found, error = None, wrench_error(model, wrench)
    if error > TRUSTED * model.length:
        share = np.sqrt(TRUSTED * model.length / error)
        raise InputError(
            f"the loads move the effectors so far that the model would be wrong by about {error:.2g} mm, "
            f"and {TRUSTED * model.length:.2g} mm are allowed ({100 * TRUSTED:g} % of the length)",
            do=f"take at most {share:.0%} of them, or give them to the scene and sample it",
        )
    if found is None:
        arrays = {**model.arrays, "series": _series(model, wrench)}
        parameters = [one for one in model.meta["parameters"] if not one["exact"]]
        found = SpectralPredictor({**model.meta, "parameters": parameters}, arrays)
    found.meta = {**found.meta, "wrench": wrench.tolist(), "wrench_error": error}
    found.domain = _domain(model, found)
    found.meta["domain"] = found.domain.to_json()
    serial = isinstance(model, SerialPredictor)  # whose modules bear the wrench each for itself
    found.skin_source = model.skin_source if serial else lambda: skin_under(model, wrench)
    return found


def wrench_error(model: SpectralPredictor, wrench: np.ndarray) -> float:
    """mm: about how far the loaded model is wrong where that is worst among the training states. Without D: a slender
    body that a force moves by d is stiffer or softer after it by a share of about d over its length, d^2 / length. With
    D: the terms of e_w fall like a geometric series, so that the first left out is the square of the last over the one
    before."""
    n_e, moves = model.rows.n_e, _translations(model)
    values = _basis_of_states(model) @ _independent(model)
    C = values[:, 1 + n_e :][:, unpacking(n_e)]
    first = np.linalg.norm((C @ wrench)[:, moves], axis=1)
    if THIRD not in model.arrays:
        return float((first**2).max() / model.length)
    D = (_basis_of_states(model) @ model.arrays[THIRD].T)[:, unpacking3(n_e)]
    second = np.linalg.norm((D @ wrench @ wrench / 2)[:, moves], axis=1)
    return float((second**2 / np.where(first > 0, first, 1.0)).max())


def _independent(model: SpectralPredictor) -> np.ndarray:
    """(M, q) coefficients of the potential, of e and of the packed C."""
    rows, series = layout(model.rows.n_a, model.rows.n_e), model.arrays["series"]
    return np.concatenate([series[rows[name]] for name in ("energy", "effector", "effector_compliance")]).T


def _series(model: SpectralPredictor, w: np.ndarray) -> np.ndarray:
    """(n_out, M) of the loaded model."""
    n_a, n_e = model.rows.n_a, model.rows.n_e
    coefficients = _independent(model)
    psi, e, packed = np.split(coefficients, [1, 1 + n_e], axis=1)
    C = packed[:, unpacking(n_e)]
    moved = C @ w  # (M, n_e)
    work = (e + moved / 2) @ w[:, None]
    if THIRD in model.arrays:
        D = model.arrays[THIRD].T[:, unpacking3(n_e)]
        stiffened = D @ w  # (M, n_e, n_e)
        work += (stiffened @ w) @ w[:, None] / 6
        moved = moved + stiffened @ w / 2
        packed = packed + pack_upper(stiffened)
    psi = psi + work if model.form == "force" else psi - work
    return differentiated(model.arrays["indices"], model.arrays["to_box"], n_a, psi, e + moved, packed)


def _domain(model: Predictor, found: Predictor) -> Domain:
    """Where the model was trained, moved by what the wrench changes: the forces at the same displacements, or the
    displacements under the same forces."""
    old, n_a, by_displacement = model.domain, model.rows.n_a, model.form == "displacement"
    s = old.states[:, :n_a] if by_displacement else old.states[:, n_a : 2 * n_a]
    change = np.array(
        [_dual(found, one, q) - _dual(model, one, q) for one, q in zip(s, old.states[:, 2 * n_a :], strict=True)]
    )
    lowest, highest = change.min(axis=0), change.max(axis=0)
    states, boxes = old.states.copy(), {"delta_a": old.delta_a, "lambda_a": old.lambda_a}
    dual = "lambda_a" if by_displacement else "delta_a"
    boxes[dual] = np.stack([boxes[dual][0] + lowest, boxes[dual][1] + highest])
    first = n_a if by_displacement else 0
    states[:, first : first + n_a] += change
    return Domain(boxes["delta_a"], boxes["lambda_a"], old.p, states)


def _dual(model: ArrayPredictor, s: np.ndarray, q: np.ndarray) -> np.ndarray:
    """(n_a,) forces at displacements s, or displacements under forces s."""
    W, free = model.learned(s, q)
    a = model.rows.a
    return np.linalg.solve(W[a, a], s - free[a]) if model.form == "displacement" else W[a, a] @ s + free[a]


def _basis_of_states(model: SpectralPredictor) -> np.ndarray:
    """(k, M) the basis at the training states that the domain keeps."""
    n_a, states = model.rows.n_a, model.domain.states
    s = states[:, :n_a] if model.form == "displacement" else states[:, n_a : 2 * n_a]
    return model.basis(np.hstack([s, states[:, 2 * n_a :]]))


def _translations(model: Predictor) -> np.ndarray:
    """(n_e,) which effector rows are displacements."""
    return np.array([unit == "mm" for unit, _ in model.rows.effector_units])
