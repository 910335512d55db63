"""A robot that moves, made by hand: the statics of a learned one, and inertia, viscosity and inner motions of series
with random coefficients."""

import numpy as np

from cfem.motion.model import MotionModel, layout
from cfem.predict.protocol import Predictor

N_R = 3


def moving(static: Predictor, prony: tuple = ()) -> MotionModel:
    rng, n_a, n_e = np.random.default_rng(0), static.rows.n_a, static.rows.n_e
    n_q, indices = n_a + N_R, np.array([(0, 0), (1, 0), (0, 1), (2, 0), (1, 1)])
    where = layout(n_q, N_R, n_e, 1)
    series = np.zeros((where["F0"].stop, len(indices)))
    on_diagonal = np.flatnonzero(np.equal(*np.triu_indices(n_q)))
    for name, size in (("M", 1.0), ("F0", 0.5)):
        series[where[name]] = 0.1 * size * rng.standard_normal((where[name].stop - where[name].start, len(indices)))
        series[where[name]][on_diagonal, 0] += size
    series[where["H"]] = 0.3 * rng.standard_normal((n_e * N_R, len(indices)))
    stiffness, scale = 0.5, np.array([1.0, 0.8, 2.0, 2.0, 2.0])
    W = static.at_displacement(0.4 * static.reach[:, 1]).W_aa
    slow = np.sqrt(np.linalg.norm(np.linalg.inv(W))) / (2 * np.pi * 10.0)  # about 10 Hz
    series[where["M"]] *= slow
    series[where["F0"]] *= np.sqrt(np.linalg.norm(np.linalg.inv(W)))
    arrays = {"to_box": static.arrays["to_box"], "offset": static.arrays["offset"], "indices": indices}
    arrays |= {"series": series, "scale": scale, "stiffness": np.array(stiffness)}
    arrays["curve"] = 0.02 * rng.standard_normal((n_e * N_R * (N_R + 1) // 2, len(indices)))
    return MotionModel(static, arrays, [{"relaxation": 3e-3, "prony": list(prony)}])
