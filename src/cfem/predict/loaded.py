"""A model under a constant load that its samples did not carry: a payload, a push, a weight in another direction.

A wrench w (n_e,) on the effectors' rows adds its work to the potential. To second order in w, with C the compliance of
the effectors' rows at the state (`cfem.predict.energy`), the loaded robot is again one of an energy:

    form displacement   Psi_w  = Psi  - w . e - w . C w / 2        gradient: the forces that hold the actuators there
    form force          Psi*_w = Psi* + w . e + w . C w / 2        gradient: where the actuators then are
    both                e_w = e + C w                              C_w = C

as d Psi_w / dw = -e_w (Castigliano; Washizu, *Variational Methods in Elasticity and Plasticity*, 1982, chapter 2). All
three are series of one basis, so that a constant wrench is a sum of their coefficients: a loaded model costs nothing to
evaluate, and exports as any other. What is left out of e_w is of second order in w."""

from collections.abc import Mapping, Sequence

import numpy as np

from cfem.condensed import Rows
from cfem.core.errors import InputError, SpecError
from cfem.predict.domain import Domain
from cfem.predict.energy import layout, unpacking
from cfem.predict.protocol import Predictor
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


def loaded(model: Predictor, wrench: np.ndarray) -> SpectralPredictor:
    """The model under a wrench (n_e,) N or N mm on its effector rows, at the reference of parameters that are exact
    without loads.

    Effectors stay relative to where they rest without load. InputError where the model is no series, the wrench is not
    finite, or so large that the estimated error (`wrench_error`) exceeds half a percent of the robot's length."""
    wrench = np.asarray(wrench, float)
    if not isinstance(model, SpectralPredictor):
        raise InputError(f"loads need a model of kind spectral, not {model.meta['kind']}", do="train one")
    if wrench.shape != (model.rows.n_e,) or not np.isfinite(wrench).all():
        raise InputError(f"a wrench has {model.rows.n_e} finite numbers, one for each effector row")
    error = wrench_error(model, wrench)
    if error > TRUSTED * model.length:
        share = np.sqrt(TRUSTED * model.length / error)
        raise InputError(
            f"the loads move the effectors so far that the model would be wrong by about {error:.2g} mm",
            do=f"take at most {share:.0%} of them, or give them to the scene and sample it",
        )
    arrays = {**model.arrays, "series": _series(model, wrench)}
    meta = {
        **model.meta,
        "parameters": [one for one in model.meta["parameters"] if not one["exact"]],
        "wrench": wrench.tolist(),
        "wrench_error": error,
    }
    found = SpectralPredictor(meta, arrays)
    meta["domain"] = _domain(model, found).to_json()
    return SpectralPredictor(meta, arrays)


def wrench_error(model: SpectralPredictor, wrench: np.ndarray) -> float:
    """mm: about how far the loaded model is off where that is worst among the training states. A slender body that a
    force moves by d is stiffer or softer after it by a share of about d over its length, which is what C_w = C leaves
    out: d^2 / length."""
    C = _parts_of_states(model)["effector_compliance"]
    moved = (C @ wrench)[:, _translations(model)]
    return float((moved**2).sum(axis=1).max() / model.length)


def _series(model: SpectralPredictor, w: np.ndarray) -> np.ndarray:
    """(n_out, M) of the loaded model."""
    n_a, n_e = model.rows.n_a, model.rows.n_e
    rows, series = layout(n_a, n_e), model.arrays["series"]
    psi, e, packed = (series[rows[name]].T for name in ("energy", "effector", "effector_compliance"))
    moved = packed[:, unpacking(n_e)] @ w  # (M, n_e) of C w
    work = (e + moved / 2) @ w[:, None]
    psi = psi + work if model.form == "force" else psi - work
    return differentiated(model.arrays["indices"], model.arrays["to_box"], n_a, psi, e + moved, packed)


def _domain(model: SpectralPredictor, found: SpectralPredictor) -> Domain:
    """Where the model was trained, moved by what the wrench changes: the forces at the same displacements, or the
    displacements under the same forces."""
    before, after = _parts_of_states(model), _parts_of_states(found, model.domain)
    change = after["gradient"] - before["gradient"]
    old, n_a = model.domain, model.rows.n_a
    lowest, highest = change.min(axis=0), change.max(axis=0)
    states, boxes = old.states.copy(), {"delta_a": old.delta_a, "lambda_a": old.lambda_a}
    dual = "lambda_a" if model.form == "displacement" else "delta_a"
    boxes[dual] = np.stack([boxes[dual][0] + lowest, boxes[dual][1] + highest])
    first = n_a if model.form == "displacement" else 0
    states[:, first : first + n_a] += change
    return Domain(boxes["delta_a"], boxes["lambda_a"], old.p, states)


def _parts_of_states(model: SpectralPredictor, domain: Domain | None = None) -> dict[str, np.ndarray]:
    """All parts at the training states that the domain keeps."""
    n_a, states = model.rows.n_a, (domain or model.domain).states
    s = states[:, :n_a] if model.form == "displacement" else states[:, n_a : 2 * n_a]
    return model.parts(s, states[:, 2 * n_a :])


def _translations(model: Predictor) -> np.ndarray:
    """(n_e,) which effector rows are displacements."""
    return np.array([unit == "mm" for unit, _ in model.rows.effector_units])
