"""Streams of samples that a sensor spoils for a while, then no more."""

from collections.abc import Callable

import numpy as np

KINDS = ("single", "burst", "not finite", "stuck", "2 %", "30 %")
MOST = 40  # ticks at the end of a bad time, in which a sensor fails altogether


def spoiling(kind: str, rng: np.random.Generator, ticks: int) -> Callable[[int, np.ndarray], np.ndarray]:
    """(tick from 0 to `ticks`, sample (...,)) -> what the sensor says instead. Outliers are 1 mm to 1e6 mm away, evenly
    in the logarithm, in any direction: the last one of the bad time alone, all of its last ticks, or a share. The last
    ticks that are stuck or not finite are up to 40."""
    begin, kept = ticks - int(rng.integers(2, MOST)), {}
    share = {"2 %": 0.02, "30 %": 0.3}

    def outlier(sample: np.ndarray) -> np.ndarray:
        away = rng.normal(size=sample.shape)
        return sample + 10.0 ** rng.uniform(0, 6) * away / np.linalg.norm(away)

    def spoilt(tick: int, sample: np.ndarray) -> np.ndarray:
        if kind in share:
            return outlier(sample) if rng.random() < share[kind] else sample
        if tick < (ticks - 1 if kind == "single" else begin):
            return sample
        if kind == "stuck":
            return kept.setdefault("sample", sample.copy())
        if kind == "not finite":
            return np.where(rng.random(sample.shape) < 0.5, rng.choice([np.nan, np.inf, -np.inf]), sample)
        return outlier(sample)

    return spoilt
