"""Patches of modules in a row that bear forces, as values."""

from dataclasses import dataclass

import numpy as np

from cfem.constraint.patch import PatchLoad
from cfem.predict.series.skin import LearnedSkin


@dataclass(frozen=True)
class RowPatches:
    """Patches of each of k modules that bear forces.

    each:   (k,) patches of a module, in the frame at its base
    skins:  (k,) skin of a module
    places: largest number of patches of any module
    rests:  (k, 3 places) mm, places of the patches at rest in that frame; 0 where a module has fewer
    forces: (k, 3 places) N in the frame of the whole row; 0 where a module has fewer"""

    each: tuple[tuple[PatchLoad, ...], ...]
    skins: tuple[LearnedSkin, ...]
    places: int
    rests: np.ndarray
    forces: np.ndarray

    @classmethod
    def none(cls, k: int) -> "RowPatches":
        """No patch on any of k modules."""
        return cls(((),) * k, (), 0, np.zeros((k, 0)), np.zeros((k, 0)))
