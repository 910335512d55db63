"""Surfaces of the robots of a scene, one after another, as compiled loops take them: what does not change between
steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.contact.surface.surface_part import SurfacePart
from cfem.predict.protocol import Predictor


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Surfaces (r) of N points together."""

    models: Sequence[SurfaceModel | SurfacePart]

    @cached_property
    def last(self) -> list[Any]:
        """What `LoadedRobots` has joined of these surfaces, None or one of it."""
        return []

    @cached_property
    def ends(self) -> list[int]:
        """Indices at which the points of each surface begin among all, and their number."""
        return list(accumulate((len(model.patches) for model in self.models), initial=0))

    @cached_property
    def bodies(self) -> np.ndarray:
        """(N,) number of the surface of each point."""
        return np.repeat(np.arange(len(self.models)), np.diff(self.ends))

    @cached_property
    def numbers(self) -> np.ndarray:
        """(N,) of the points among all of their robot."""
        return np.concatenate([model.numbers for model in self.models])

    @cached_property
    def held_still(self) -> np.ndarray:
        """(N,) bool: points where a body is held, which touch nothing."""
        return np.concatenate([model.held_still for model in self.models])

    @cached_property
    def most(self) -> int:
        """Points that may touch obstacles at once."""
        return max(model.most for model in self.models)

    @cached_property
    def rest(self) -> np.ndarray:
        """(N, 3) mm in the frames of the robots."""
        return np.concatenate([model.patches.rest for model in self.models])

    @cached_property
    def flat(self) -> np.ndarray:
        """(sum of 3 n k,) the modes (3 n, k) of each surface."""
        each = [np.ascontiguousarray(model.flat).reshape(-1) for model in self.models]
        return each[0] if len(each) == 1 else np.concatenate(each)

    @cached_property
    def shapes(self) -> np.ndarray:
        """(r, 4) numbers of points, modes, mixtures of modes and effectors of each surface."""
        each = [(len(model.patches), *model.bends.shape, model.model.rows.n_e) for model in self.models]
        return np.array(each, dtype=np.int64)

    @cached_property
    def predictors(self) -> list[Predictor]:
        """Models of the robots."""
        return [model.model for model in self.models]

    @cached_property
    def actuators(self) -> np.ndarray:
        """(r,) numbers of actuators of the robots."""
        return np.array([model.model.rows.n_a for model in self.models], dtype=np.int64)

    @cached_property
    def no_wrench(self) -> np.ndarray:
        """(sum of n_e,) 0 on all effectors."""
        return np.zeros(self.shapes[:, 3].sum())

    @cached_property
    def moved_at_most(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`size` (r,), `moved_by_row` (sum of k,) and `moved_by_wrench` (sum of n_e,) of the whole surfaces."""
        whole = [model.whole for model in self.models]
        by = (np.concatenate([getattr(it, name) for it in whole]) for name in ("moved_by_row", "moved_by_wrench"))
        return np.array([it.size for it in whole]), *by

    @cached_property
    def mode_ends(self) -> list[tuple[int, int]]:
        """First and last number of each surface's modes among those of all."""
        return _ends(self.shapes[:, 1])

    @cached_property
    def effector_ends(self) -> list[tuple[int, int]]:
        """First and last number of each robot's effectors among those of all."""
        return _ends(self.shapes[:, 3])

    @cached_property
    def actuator_ends(self) -> list[tuple[int, int]]:
        """First and last number of each robot's actuators among those of all."""
        return _ends(self.actuators)


def _ends(counts: np.ndarray) -> list[tuple[int, int]]:
    return list(pairwise(accumulate(counts.tolist(), initial=0)))
