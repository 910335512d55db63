"""The skin of a model under a constant wrench: s_w = s + C_se w, to first order as its effectors move."""

from collections.abc import Sequence

import numpy as np

from cfem.predict.protocol import Predictor
from cfem.predict.skin import LearnedSkin


def skin_under(model: Predictor, wrench: np.ndarray) -> LearnedSkin | None:
    """The skin of the loaded robot, if the model has one."""
    if model.skin_source() is None:
        return None
    arrays = loaded_skin(model, model.skin.arrays, wrench)
    return LearnedSkin(model.form, model.rows.n_e, model.rows.n_a, model.n_inputs, arrays)


def loaded_skin(model: Predictor, arrays: dict[str, np.ndarray], wrench: Sequence[float]) -> dict[str, np.ndarray]:
    """The arrays of `cfem.predict.skin` of a model under a wrench (n_e,) N and N mm."""
    n_e, k = model.rows.n_e, len(arrays["modes"])
    C_es = arrays["compliance"][: n_e * k].reshape(n_e, k, -1)
    moved = np.tensordot(np.asarray(wrench, float), C_es, axes=1)  # (k, L)
    both = np.vstack([arrays["indices"], arrays["compliance_indices"]])
    union, place = np.unique(both, axis=0, return_inverse=True)
    series = np.zeros((k, len(union)))
    np.add.at(series.T, place.ravel(), np.hstack([arrays["series"], moved]).T)
    return {**arrays, "indices": union, "series": series}
