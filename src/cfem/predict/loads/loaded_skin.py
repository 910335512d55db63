"""The skin of a model under a constant wrench: s_w = s + C_se w + C_ss U f, to first order as its effectors move."""

from collections.abc import Sequence

import numpy as np

from cfem.condensed.packing import unpacking
from cfem.constraint.patch import PatchLoad
from cfem.predict.protocol import Predictor
from cfem.predict.series.chebyshev import union
from cfem.predict.series.skin import LearnedSkin


def skin_under(model: Predictor, wrench: np.ndarray, patches: Sequence[PatchLoad] = ()) -> LearnedSkin | None:
    """The skin of the loaded robot, if the model has one."""
    if model.skin_source() is None:
        return None
    return _of(model, loaded_skin(model, model.skin.arrays, wrench, patches))


def loaded_skin(
    model: Predictor, arrays: dict[str, np.ndarray], wrench: Sequence[float], patches: Sequence[PatchLoad] = ()
) -> dict[str, np.ndarray]:
    """The arrays of `cfem.predict.series.skin` of a model under a wrench (n_e,) N and N mm, and forces on patches."""
    n_e, k = model.rows.n_e, len(arrays["modes"])
    C_es, C_ss = np.split(arrays["compliance"], [n_e * k])
    moved = np.tensordot(np.asarray(wrench, float), C_es.reshape(n_e, k, -1), axes=1)  # (k, L)
    if patches:
        on = _of(model, arrays).modes_over(patches) @ np.concatenate([patch.force for patch in patches])
        moved = moved + np.tensordot(on, C_ss[unpacking(k)], axes=1)
    indices, (rows, more) = union(arrays["indices"], arrays["compliance_indices"])
    series = np.zeros((k, len(indices)))
    series[:, rows] = arrays["series"]
    series[:, more] += moved
    return {**arrays, "indices": indices, "series": series}


def skin_under_loads_of(model: Predictor, arrays: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The arrays of the unloaded skin, under the loads that the model has."""
    patches = [PatchLoad(**patch) for patch in model.meta.get("patch_loads") or ()]
    return loaded_skin(model, arrays, model.meta["wrench"], patches)


def _of(model: Predictor, arrays: dict[str, np.ndarray]) -> LearnedSkin:
    return LearnedSkin(model.form, model.rows.n_e, model.rows.n_a, model.n_inputs, arrays)
