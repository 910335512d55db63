"""The unknowns that a controller tracks, as one vector x, and how they change from sample to sample."""

import numpy as np

from cfem.condensed.parameters import coordinates, range_coordinates, references, values
from cfem.core.errors import InputError
from cfem.predict.protocol import Predictor

SD = 0.3  # of a parameter's range: about that of a uniform distribution
STEADY = 100.0  # times as long are samples kept of what does not change with time
RATE = 20.0  # times `forget`: in so many samples a drift crosses a parameter's standard deviation
SHARE, LOSS, DRIFT, CAMERA = range(4)


class TrackedUnknowns:
    """x (n,): shares of parameters' ranges, losses of actuators, drifts of shares per sample, camera motion.

    find: (k,) numbers of the tracked parameters
    kinds: (n,) SHARE, LOSS, DRIFT or CAMERA
    first, sd: (n,) values and standard deviations before the first sample
    low, high: (n,) bounds
    transition: (n, n) from one sample to the next; a drift adds to its share
    growth: (n,) by which standard deviations grow from sample to sample (exponential forgetting)
    moves: numbers of the camera's motions (3 mm, 3 rad) that are tracked
    """

    def __init__(
        self,
        predictor: Predictor,
        find: tuple[str, ...] | None,
        loss: float,
        camera: tuple[float, float],
        forget: float,
    ):
        """Unknowns of a model.

        find: names of parameters, all unless given
        loss, camera: standard deviations in mm or N, and in mm and rad, 0 for what is not tracked
        forget: samples after which one counts for 1/e"""
        parameters, n_a = predictor.parameters, predictor.rows.n_a
        names = [parameter.name for parameter in parameters]
        wanted = names if find is None else list(find)
        strange = [name for name in wanted if name not in names]
        if strange or not (wanted or loss or any(camera)):
            what = f"the model has no parameter '{strange[0]}'" if strange else "the model has no parameters to track"
            raise InputError(what, do=f"known are {', '.join(names) or 'none'}")
        self._parameters, self._n_a = parameters, n_a
        self.find = [names.index(name) for name in wanted]
        drifting = [n for n, i in enumerate(self.find) if parameters[i].exact]
        deviations = np.repeat(camera, 3)
        self.moves = np.flatnonzero(deviations)
        sizes = [len(wanted), n_a if loss else 0, len(drifting), len(self.moves)]
        self.kinds = np.repeat([SHARE, LOSS, DRIFT, CAMERA], sizes)
        self._low, self._high = np.array(range_coordinates(parameters))
        self._q = coordinates(parameters, references(parameters))
        share = ((self._q - self._low) / (self._high - self._low))[self.find]
        self.first = np.concatenate([share, np.zeros(sum(sizes[1:]))])
        self.sd = np.concatenate([np.repeat([SD, loss, SD / (RATE * forget)], sizes[:3]), deviations[self.moves]])
        self.low = np.where(self.kinds == SHARE, 0.0, -3 * self.sd)
        self.high = np.where(self.kinds == SHARE, 1.0, 3 * self.sd)
        lasting = [not parameters[i].exact for i in self.find] + [False] * (sizes[1] + sizes[2]) + [True] * sizes[3]
        self.growth = np.exp(0.5 / np.where(lasting, STEADY * forget, forget))
        self.transition = np.eye(len(self.first))
        self.transition[drifting, sizes[0] + sizes[1] + np.arange(sizes[2])] = 1.0

    def p(self, x: np.ndarray) -> np.ndarray:
        """The model's parameters (n_p,)."""
        if not len(self._q):
            return self._q
        q = self._q.copy()
        low, high = self._low[self.find], self._high[self.find]
        q[self.find] = low + (high - low) * x[self.kinds == SHARE]
        return values(self._parameters, q)

    def losses(self, x: np.ndarray) -> np.ndarray:
        """Losses (n_a,) mm or N of the actuators' commands."""
        return x[self.kinds == LOSS] if (self.kinds == LOSS).any() else np.zeros(self._n_a)

    def camera(self, x: np.ndarray) -> np.ndarray:
        """Motion (6,) mm and rad of the camera."""
        motion = np.zeros(6)
        motion[self.moves] = x[self.kinds == CAMERA]
        return motion
