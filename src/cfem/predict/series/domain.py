"""Domain where a model was trained, and a state's distance from it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cfem.condensed.model import Form
from cfem.condensed.spread import spread

MARGIN = 0.05  # share of each range by which the boxes are wider than the data
STATES = 128  # kept of the training states
FAR = 2.0  # gaps: a state farther than this from all of them is not among the data
_ROUNDING = 1e-9
ASIDE = 0.5  # of the data's range along each of its principal axes: how far beyond it a state is still among them


@dataclass(frozen=True)
class Domain:
    """The states that a model was trained on. Pulling states fill a wedge of the displacements, whose box would be
    mostly empty: the box of the multipliers cuts the wedge out of it. More cables than the body has ways to bend fill a
    thin sheet, beside which the multipliers of a model are wrong too: the principal axes of the sheet bound it.

    delta_a, lambda_a: (2, n_a) smallest and largest of the training states, with a margin
    p: (2, n_p) the same of the parameters' coordinates
    states: (k, 2 n_a + n_p) some of the training states, spread over all of them"""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    p: np.ndarray
    states: np.ndarray

    @classmethod
    def of(cls, delta_a: np.ndarray, lambda_a: np.ndarray, p: np.ndarray | None = None) -> "Domain":
        """Domain of training states: displacements and multipliers (m, n_a), and coordinates (m, n_p) of the
        parameters."""
        p = np.zeros((len(delta_a), 0)) if p is None else p
        states = np.hstack([delta_a, lambda_a, p])
        scaled = states / _range(_box(states))
        middle = int(np.argmin(((scaled - scaled.mean(axis=0)) ** 2).sum(axis=1)))
        return cls(_box(delta_a), _box(lambda_a), _box(p), states[spread(scaled, STATES, middle)])

    @classmethod
    def from_json(cls, data: dict) -> "Domain":
        return cls(*(np.asarray(data[name], float) for name in cls.__dataclass_fields__))

    def to_json(self) -> dict:
        return {name: getattr(self, name).tolist() for name in self.__dataclass_fields__}

    def outside(self, delta_a: np.ndarray, lambda_a: np.ndarray, p: np.ndarray | None = None) -> float | np.ndarray:
        """Distances (...,) by which states (..., n_a) lie outside the boxes, as shares of their widths; 0 inside."""
        low, high = self._box
        state = self._state(delta_a, lambda_a, p)
        return _plain((np.maximum(low - state, state - high) / _range(self._box)).max(axis=-1, initial=0.0))

    def distance(self, delta_a: np.ndarray, lambda_a: np.ndarray, p: np.ndarray | None = None) -> float | np.ndarray:
        """Distances (...,) from states (..., n_a) to the nearest kept training state, in units of the largest gap
        between one of them and its nearest neighbour: about 1 or less among the data, however many there are."""
        width = _range(self._box)
        offsets = (self.states - self._state(delta_a, lambda_a, p)[..., None, :]) / width
        return _plain(np.sqrt((offsets**2).sum(axis=-1).min(axis=-1)) / self._gap)

    def holds(self, delta_a: np.ndarray, lambda_a: np.ndarray, p: np.ndarray | None = None) -> bool | np.ndarray:
        """Mask (...,) of the states (..., n_a) that are like those that the model was trained on."""
        within = np.equal(self.outside(delta_a, lambda_a, p), 0.0) & self._on_sheet(delta_a)
        return _plain(within & np.less_equal(self.distance(delta_a, lambda_a, p), FAR))

    def nearest(self, s: np.ndarray, form: Form, p: np.ndarray | None = None) -> np.ndarray:
        """Multipliers (n_a,) (form 'displacement') or displacements ('force') of the kept state whose displacements
        (multipliers) and parameters are nearest to s (n_a,), p (n_p,)."""
        n_a = len(s)
        mine, answer = slice(n_a), slice(n_a, 2 * n_a)
        if form == "force":
            mine, answer = answer, mine
        known, width = self.states, _range(self._box)
        apart = (((known[:, mine] - s) / width[mine]) ** 2).sum(axis=1)
        if p is not None and len(p):
            apart += (((known[:, 2 * n_a :] - p) / width[2 * n_a :]) ** 2).sum(axis=1)
        return known[np.argmin(apart), answer]

    def _on_sheet(self, delta_a: np.ndarray) -> np.ndarray:
        """Mask (...,) of the displacements (..., n_a) that lie in the sheet."""
        axes, (low, high) = self.sheet
        along = delta_a @ axes.T
        return ((low <= along) & (along <= high)).all(axis=-1)

    @cached_property
    def sheet(self) -> tuple[np.ndarray, np.ndarray]:
        """Principal axes (k, n_a) of the kept states' displacements, those along which they differ,
        and the bounds (2, k) along each between which a state is still among them."""
        known = self.states[:, : self.delta_a.shape[1]]
        width = _range(self.delta_a)
        scaled = known / width
        _, size, axes = np.linalg.svd(scaled - scaled.mean(axis=0), full_matrices=False)
        axes = axes[size > _ROUNDING * size.max(initial=1.0)] / width
        along = known @ axes.T
        low, high = along.min(axis=0), along.max(axis=0)
        return axes, np.stack([low - ASIDE * (high - low), high + ASIDE * (high - low)])

    @cached_property
    def _box(self) -> np.ndarray:
        return np.hstack([self.delta_a, self.lambda_a, self.p])

    @cached_property
    def _gap(self) -> float:
        scaled = self.states / _range(self._box)
        apart = np.linalg.norm(scaled[:, None] - scaled, axis=2)
        np.fill_diagonal(apart, np.inf)
        return float(apart.min(axis=1).max()) if len(apart) > 1 else 1.0

    def _state(self, delta_a: np.ndarray, lambda_a: np.ndarray, p: np.ndarray | None) -> np.ndarray:
        """Displacements, multipliers and parameters joined, (..., 2 n_a + n_p)."""
        p = np.zeros(0) if p is None else p
        return np.concatenate([delta_a, lambda_a, np.broadcast_to(p, (*delta_a.shape[:-1], p.shape[-1]))], axis=-1)


def _box(states: np.ndarray) -> np.ndarray:
    low, high = states.min(axis=0), states.max(axis=0)
    return np.stack([low - MARGIN * (high - low), high + MARGIN * (high - low)])


def _plain(values: np.ndarray) -> float | bool | np.ndarray:
    """A Python number where there is one state, which JSON takes."""
    return values.item() if np.ndim(values) == 0 else values


def _range(box: np.ndarray) -> np.ndarray:
    width = box[1] - box[0]
    return np.where(width > 0, width, 1.0)
