"""A batch of robots of one model, in equilibrium under their commands: what the environments act on."""

from dataclasses import dataclass

import numpy as np

from cfem.condensed.parameters import coordinates, values
from cfem.core.errors import InputError
from cfem.core.optional import demand
from cfem.predict.energy import layout, unpacking
from cfem.predict.protocol import Predictor
from cfem.predict.spectral import SpectralPredictor

PUSHES = 0.1  # of the largest force: training states beyond so much of the other sign mean actuators that push


@dataclass
class States:
    """B robots. delta_a (B, n_a) mm; lambda_a (B, n_a) N; tip (B, n_e) mm from rest; compliance (B, n_e, n_e) mm/N of
    the effectors at locked actuators; failed: how many found no equilibrium in the last step."""

    delta_a: np.ndarray
    lambda_a: np.ndarray
    tip: np.ndarray
    compliance: np.ndarray
    failed: int


class Robots:
    """model: spectral, of form displacement. InputError for others."""

    def __init__(self, model: Predictor, compliance: bool = False):
        demand("numba", where="cfem.gym")
        if not isinstance(model, SpectralPredictor) or model.form != "displacement":
            kind, form = model.meta.get("kind"), model.form
            what = f"environments need a spectral model of form displacement, got kind '{kind}' of form '{form}'"
            raise InputError(what, do="train with `model: {kind: spectral}`")
        from cfem.gym.kernel import equilibria

        self.model, self._equilibria = model, equilibria
        n_a, n_e = model.rows.n_a, model.rows.n_e
        parts, arrays = layout(n_a, n_e), model.arrays
        wanted = ["gradient", "hessian", "effector"] + (["effector_compliance"] if compliance else [])
        self._ends = np.cumsum([parts[name].stop - parts[name].start for name in wanted])
        rows = np.concatenate([arrays["series"][parts[name]] for name in wanted])
        self._series = np.ascontiguousarray(rows.T)
        self._to_box, self._offset = np.ascontiguousarray(arrays["to_box"]), np.ascontiguousarray(arrays["offset"])
        self._indices = np.ascontiguousarray(arrays["indices"].astype(np.int64))
        self._degree = int(self._indices.max())
        self._unpack = unpacking(n_e)
        low, high = model.domain.lambda_a
        self.pulls = bool((low > -PUSHES * high).all())
        self.largest_force = high.copy()
        self._reference = np.array([one.reference for one in model.parameters])

    def start(self, count: int) -> States:
        """All at rest, as far as the model knows it."""
        n_a, n_e = self.model.rows.n_a, self.model.rows.n_e
        room = (np.zeros((count, n_a)), np.zeros((count, n_a)), np.zeros((count, n_e)), np.zeros((count, n_e, n_e)))
        return States(*room, 0)

    def move(self, states: States, u: np.ndarray, p: np.ndarray | None = None, forces: bool = False) -> States:
        """Under commands u (B, n_a), displacements in mm or forces in N, parameters p (B, n_p): the scene's unless
        given."""
        model, count = self.model, len(u)
        p = np.broadcast_to(self._reference, (count, len(self._reference))) if p is None else p
        q, softer = model.q(p).reshape(count, -1), np.broadcast_to(model.softer(p), (count,)).astype(float)
        out, delta = np.zeros((count, self._series.shape[1])), states.delta_a.copy()
        out[:, : model.rows.n_a] = states.lambda_a  # who was slack
        failed = self._equilibria(
            np.ascontiguousarray(u, float),
            forces,
            self.pulls,
            delta,
            np.ascontiguousarray(q),
            softer,
            self._to_box,
            self._offset,
            self._indices,
            self._series,
            self._degree,
            0.25 * float(np.abs(model.reach).max()),
            1e-6 * float(self.largest_force.max()),
            out,
        )
        e = self._ends[2]
        lam, tip = out[:, : self._ends[0]] / softer[:, None], out[:, self._ends[1] : e]
        C = states.compliance
        if len(self._ends) > 3:
            C = out[:, e:][:, self._unpack] * softer[:, None, None]
        return States(delta, lam, tip, C, int(failed))

    def random_parameters(self, rng: np.random.Generator, count: int) -> np.ndarray:
        """(count, n_p), uniform in the coordinates in which the model is smooth."""
        own = self.model.parameters
        if not own:
            return np.zeros((count, 0))
        low, high = (coordinates(own, np.array([getattr(one, end) for one in own])) for end in ("low", "high"))
        return values(own, low + (high - low) * rng.random((count, len(own))))

    def feasible(self, rng: np.random.Generator, count: int, share: float = 0.7) -> States:
        """States under random forces, up to `share` of the largest of the training, that stand within the reach."""
        kept: list[States] = []
        while sum(len(one.tip) for one in kept) < count:
            u = rng.uniform(0.0 if self.pulls else -share, share, (2 * count, len(self.largest_force)))
            start = self.start(len(u))
            start.delta_a[:] = self.model.domain.states[0, : u.shape[1]]
            found = self.move(start, u * self.largest_force, forces=True)
            low, high = self.model.reach.T
            good = (
                (found.delta_a >= low) & (found.delta_a <= high) & np.isfinite(found.tip).all(axis=1, keepdims=True)
            ).all(axis=1)
            kept.append(picked(found, good))
            if not good.any():
                raise InputError("the model's states under forces do not lie within the reach of its actuators")
        joined = {name: np.concatenate([getattr(one, name) for one in kept])[:count] for name in FIELDS}
        return States(**joined, failed=0)


FIELDS = ("delta_a", "lambda_a", "tip", "compliance")


def picked(states: States, which: np.ndarray) -> States:
    """Those of a mask or of indices."""
    return States(**{name: getattr(states, name)[which] for name in FIELDS}, failed=0)
