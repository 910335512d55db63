"""What every runnable model offers, whatever its kind and runtime."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Condensed, Rows
from cfem.condensed.parameters import coordinates, from_json, references
from cfem.core.errors import InputError, NumericalError
from cfem.predict.domain import Domain
from cfem.predict.energy import Form
from cfem.predict.skin import LearnedSkin


class Predictor(ABC):
    """A model of (W, delta_free), with what its users must know about it.

    meta:   model.json
    rows:   names and order e, a of the rows of W
    form:   what it is a function of: 'displacement', s = delta_a, or 'force', s = lambda_a
    actuator_units: of each actuator's displacement and force: mm and N of a cable, mm^3 and MPa of a chamber
    parameters: the design and material parameters p that it takes as well; the scene's own values where none are given
    rest_e: (n_e,) mm rest positions of the effectors; reach: (n_a, 2) mm; length: mm, what '% of length' refers to
    sizes: (n_e,) in whose squares its locked compliance is made semidefinite (semidefinite.py), None where it is not
    domain: where it was trained"""

    def __init__(self, meta: dict):
        self.meta = meta
        self.rows = Rows(tuple(meta["rows"]["effectors"]), tuple(meta["rows"]["actuators"]))
        self.form: Form = meta["form"]
        ends = self.rows.n_e, self.rows.n - meta.get("n_c", 0)  # the pose of a held patch is driven by no actuator
        self.actuator_units = tuple((one, other) for one, other in meta["row_units"][slice(*ends)])
        self.parameters = from_json(meta["parameters"])
        self.rest_e = np.asarray(meta["rest_e"], float)
        self.reach = np.asarray(meta["reach"], float)
        self.length = float(meta["length"])
        self.sizes = None if meta.get("semidefinite") is None else np.asarray(meta["semidefinite"], float)
        self.domain = Domain.from_json(meta["domain"])
        self._reference = references(self.parameters)
        self._learned = [i for i, one in enumerate(self.parameters) if not one.exact]
        self._exact = [i for i, one in enumerate(self.parameters) if one.exact]
        self.skin_source: Callable[[], LearnedSkin | None] = lambda: None

    @cached_property
    def skin(self) -> LearnedSkin:
        """The model's skin, read when it is first asked for. InputError where it has none."""
        found = self.skin_source()
        if found is None:
            do = "sample it with `skin: {}` in sample.yaml, and train again"
            raise InputError(f"the model of scene '{self.meta['scene']}' has no skin", do=do)
        return found

    @property
    def facets(self) -> np.ndarray:
        """(t, 3) triangles of the surface, normals outward: numbers of nodes as `shape` has them."""
        return self.skin.triangles

    def shape(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        """(..., m, 3) mm positions of all surface nodes where the actuators stand at delta_a (..., n_a) mm; p (n_p,) or
        (..., n_p). InputError where the model has no skin, or one of another geometry than p's."""
        return self.skin.surface(self._skin_rows(delta_a, p))

    def all_nodes(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        """(..., n, 3) mm as `shape`, of all nodes inside and outside, in the order of the mesh. InputError where the
        samples had the surface alone."""
        return self.skin.all_nodes(self._skin_rows(delta_a, p))

    def _skin_rows(self, delta_a: ArrayLike, p: ArrayLike | None) -> np.ndarray:
        moved = [one.name for one in self.parameters if one.moves_body]
        if p is not None and moved:
            what = f"the shape of other designs is not known: '{moved[0]}' changes where the surface rests"
            raise InputError(what, do="leave the parameters out, for the scene's own design")
        return self.skin.rows(*self.learned_inputs(delta_a, p))

    def whole(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """As `at_displacement`, with the rows of the skin between effectors and actuators."""
        softer = float(self.softer(self._p(p))) if self.parameters else 1.0
        return self.skin.joined(self.at_displacement(delta_a, p), *self.learned_inputs(delta_a, p), softer)

    def learned_inputs(self, delta_a: ArrayLike, p: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
        """s (..., n_a) of the form at the reference of exact parameters, and q (..., n_q), at displacements."""
        s = np.asarray(delta_a, float)
        if s.shape[-1:] != (self.rows.n_a,) or not np.isfinite(s).all():
            raise self._not_one_each(delta_a, "a state of displacements")
        p = np.broadcast_to(self._p(p), (*s.shape[:-1], len(self.parameters)))
        if self.form == "force":
            flat = s.reshape(-1, s.shape[-1])
            places = zip(flat, p.reshape(len(flat), p.shape[-1]), strict=True)  # p may have no columns
            s = np.array([self.at_displacement(*one).lambda_a for one in places]).reshape(s.shape)
            s = s * self.softer(p)[..., None]
        return s, self.q(p)

    @property
    def n_inputs(self) -> int:
        """Of what is learned: actuators, and coordinates of the parameters that are not exact."""
        return self.rows.n_a + len(self._learned)

    @abstractmethod
    def evaluate(self, s: np.ndarray, p: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(..., n_a) mm or N by the form, (..., n_p) -> W (..., n, n), delta_free (..., n)."""

    def softer(self, p: np.ndarray) -> np.ndarray:
        """(..., n_p) -> (...) reference over Young's modulus where its effect is exact (identity 6 of the condensed
        model: W ~ 1/E, lambda ~ E), else 1."""
        return np.prod(self._reference[self._exact] / p[..., self._exact], axis=-1)

    def q(self, p: np.ndarray | None) -> np.ndarray:
        """(..., n_p) -> (..., n_q) coordinates of the parameters that are learned."""
        p = self._p(p)
        if not self._learned:
            return p[..., :0]
        return coordinates([self.parameters[i] for i in self._learned], p[..., self._learned])

    def at(self, s: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """The condensed robot at one input s (n_a,) of the form; effectors from their rest position."""
        s = np.asarray(s, float)
        W, delta_free = self.evaluate(s, p)
        a = self.rows.a
        lam = s if self.form == "force" else np.linalg.solve(W[a, a], s - delta_free[a])
        return Condensed(self.rows, W, delta_free, lam)

    def at_displacement(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """The condensed robot where its actuators stand at delta_a (n_a,) mm. NumericalError where there is none,
        and far outside the domain."""
        delta_a = self._one_each(delta_a, "a state of displacements")
        self._demand_near(delta_a, self.domain.delta_a, "displacements", "mm")
        return self.at(delta_a, p) if self.form == "displacement" else self._find(delta_a, p)

    def at_force(self, lambda_a: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """The condensed robot under lambda_a (n_a,) N. NumericalError where there is none, and far outside the
        domain."""
        lambda_a = self._one_each(lambda_a, "a state of forces")
        softer = float(self.softer(self._p(p))) if self.parameters else 1.0
        self._demand_near(lambda_a, self.domain.lambda_a / softer, "forces", "N")
        return self.at(lambda_a, p) if self.form == "force" else self._find(lambda_a, p)

    def _one_each(self, values: ArrayLike, what: str) -> np.ndarray:
        """InputError where these are not a finite number for each actuator."""
        array = np.asarray(values, float)
        if array.shape != (self.rows.n_a,) or not np.isfinite(array).all():
            raise self._not_one_each(values, what)
        return array

    def _demand_near(self, state: np.ndarray, box: np.ndarray, what: str, unit: str) -> None:
        """NumericalError where a state lies outside the box (2, n_a) of the training states by more than its width: the
        answer would be wrong by orders of magnitude."""
        low, high = box
        width = np.where(high > low, high - low, np.inf)  # one value alone tells nothing of what is far
        if (np.maximum(low - state, state - high) > width).any():
            ranges = ", ".join(
                f"{name} {one:.3g} to {other:.3g}"
                for name, one, other in zip(self.rows.actuators, low, high, strict=True)
            )
            raise NumericalError(
                f"{what} {np.round(state, 6).tolist()} {unit} are far outside what the model was trained on ({ranges})",
                do="ask inside, or sample a larger space and train again",
            )

    def _not_one_each(self, values: ArrayLike, what: str) -> InputError:
        names = ", ".join(self.rows.actuators)
        return InputError(f"{what} is one finite number for each actuator ({names}); got {values}")

    def _find(self, wanted: np.ndarray, p: np.ndarray | None, tolerance: float = 1e-11) -> Condensed:
        """The state whose dual quantity is `wanted` (n_a,): Newton from the nearest training state, halving steps;
        tolerance: relative to the domain's largest value. W_aa is the derivative, d delta_a / d lambda_a."""
        a = self.rows.a
        by_force = self.form == "displacement"  # what is wanted are forces, what is varied are displacements
        box = self.domain.lambda_a if by_force else self.domain.delta_a
        softer = self.softer(self._p(p)) if self.parameters else 1.0  # the domain's states are those of the reference
        start = self.domain.nearest(
            wanted * softer if by_force else wanted, "force" if by_force else "displacement", self.q(p)
        )
        here = self.at(start if by_force else start / softer, p)
        missing = wanted - (here.lam if by_force else here.delta[a])
        for _ in range(60):
            if np.abs(missing).max() <= tolerance * max(np.abs(box).max(), np.abs(wanted).max()):
                return here
            s = here.delta[a] if by_force else here.lam
            step = here.W_aa @ missing if by_force else np.linalg.solve(here.W_aa, missing)
            for share in 0.5 ** np.arange(12):
                trial = self.at(s + share * step, p)
                left = wanted - (trial.lam if by_force else trial.delta[a])
                if np.linalg.norm(left) < np.linalg.norm(missing):
                    break
            else:
                break
            here, missing = trial, left
        if np.abs(missing).max() <= 1e3 * tolerance * np.abs(box).max():  # as near as rounding lets it come
            return here
        what, unit = ("multipliers", "N") if by_force else ("displacements", "mm")
        raise NumericalError(
            f"the model finds no state of {what} {wanted.tolist()} {unit}: {np.abs(missing).max():.2g} {unit} are left",
            do="ask inside its domain",
        )

    def inside(self, condensed: Condensed, p: ArrayLike | None = None) -> bool:
        """Whether a state found with this model is like those that it was trained on."""
        return self.domain.holds(*self._where(condensed, p))

    def distance(self, condensed: Condensed, p: ArrayLike | None = None) -> float:
        """How far a state is from the training states: about 1 or less among them (`Domain.distance`)."""
        return self.domain.distance(*self._where(condensed, p))

    def _where(self, condensed: Condensed, p: np.ndarray | None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        softer = self.softer(self._p(p)) if self.parameters else 1.0
        return condensed.delta_a, condensed.lambda_a * softer, self.q(p)

    def _p(self, p: np.ndarray | None) -> np.ndarray:
        if p is None:
            return self._reference
        p = np.asarray(p, float)
        if p.shape[-1] != len(self.parameters):
            raise InputError(f"{p.shape[-1]} parameters given, the model has {[one.name for one in self.parameters]}")
        return p


class ArrayPredictor(Predictor):
    """A model that runs on arrays here. A kind says what it has learned; exact parameters are dealt with for all.

    class Mine(ArrayPredictor, kind="mine") joins the kinds that `build` knows."""

    def __init_subclass__(cls, kind: str = "", **others):
        super().__init_subclass__(**others)
        if kind:
            KINDS[kind] = cls

    @abstractmethod
    def learned(self, s: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(..., n_a) inputs of the form, (..., n_q) coordinates of the parameters that are learned -> W (..., n, n),
        delta_free (..., n), at the reference of those that are exact."""

    def evaluate(self, s: np.ndarray, p: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        if not self.parameters:
            return self.learned(s, s[..., :0])
        p = np.broadcast_to(self._p(p), (*s.shape[:-1], len(self.parameters)))
        softer = self.softer(p)[..., None]
        W, delta_free = self.learned(s * softer if self.form == "force" else s, self.q(p))
        return W * softer[..., None], delta_free


KINDS: dict[str, type[ArrayPredictor]] = {}


def build(meta: dict, arrays: dict[str, np.ndarray]) -> ArrayPredictor:
    """The NumPy predictor of a model in memory. Its kind's module must have been imported: `cfem.predict.load` imports
    all of them."""
    return KINDS[meta["kind"]](meta, arrays)
