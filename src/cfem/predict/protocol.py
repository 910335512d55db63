"""Protocol of every learned model, whatever its kind and runtime."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from cfem.condensed import Condensed, Rows
from cfem.condensed.coupling import HolderState
from cfem.condensed.mesh_error import mesh_error_of
from cfem.condensed.model import Form, demand_found, with_duals
from cfem.condensed.model_error import ContactError, StateError, model_error_of
from cfem.condensed.parameters import coordinates, demand_in_range, from_json, references
from cfem.core.console.shown import counted
from cfem.core.errors import InputError, NumericalError
from cfem.predict.series.christoffel import Christoffel
from cfem.predict.series.domain import Domain
from cfem.predict.series.skin import LearnedSkin
from cfem.predict.series.state_error import LOADS, state_error

if TYPE_CHECKING:
    from cfem.predict.workspace import Workspace

_PUSHES = 0.1  # of the largest force: training states beyond so much of the other sign mean actuators that push
_ROUNDING = 1e-8  # share of the displacements: what may be left of a state that is searched by its forces


class Predictor(ABC):
    """A model of (W, delta_free), with what its users must know about it.

    meta:   model.json
    rows:   names and order e, a of the rows of W
    form:   what it is a function of: 'displacement', s = delta_a, or 'force', s = lambda_a
    actuator_units: of each actuator's displacement and force: mm and N of a cable, mm^3 and MPa of a chamber
    parameters: the design and material parameters p that it takes as well; the scene's own values where none are given
    rest_e: (n_e,) mm rest positions of the effectors
    reach:  (n_a, 2) mm
    length: mm, what '% of length' refers to
    sizes:  (n_e,) in whose squares its locked compliance is made semidefinite (semidefinite.py), None where it is not
    domain: where it was trained
    mesh_error: of the mesh that its samples were solved on, None where nobody has estimated it
    model_error: its own, beside that mesh, None where it states none"""

    def __init__(self, meta: dict):
        """Takes over what model.json says; the skin comes from `skin_source` once it is set."""
        self.meta = meta
        self.rows = Rows(tuple(meta["rows"]["effectors"]), tuple(meta["rows"]["actuators"]))
        self.form: Form = meta["form"]
        ends = self.rows.n_e, self.rows.n - meta.get("n_c", 0)  # the pose of a held patch is driven by no actuator
        self.actuator_units = tuple(
            (parameter, force_unit) for parameter, force_unit in meta["row_units"][slice(*ends)]
        )
        self.parameters = from_json(meta["parameters"])
        self.rest_e = np.asarray(meta["rest_e"], float)
        self.reach = np.asarray(meta["reach"], float)
        self.length = float(meta["length"])
        self.sizes = None if meta.get("semidefinite") is None else np.asarray(meta["semidefinite"], float)
        self.domain = Domain.from_json(meta["domain"])
        self.mesh_error = mesh_error_of(meta.get("mesh_error"))
        self.model_error = model_error_of(meta.get("model_error"))
        self._reference = references(self.parameters)
        self._learned = [i for i, parameter in enumerate(self.parameters) if not parameter.exact]
        self._exact = [i for i, parameter in enumerate(self.parameters) if parameter.exact]
        self.skin_source: Callable[[], LearnedSkin | None] = lambda: None
        self.contact_errors_source: Callable[[], tuple[Any, ...]] = tuple

    @cached_property
    def skin(self) -> LearnedSkin:
        """The model's skin, read when it is first asked for. InputError where it has none."""
        skin = self.skin_source()
        if skin is None:
            do = "sample it with `skin: {}` in sample.yaml, and train again"
            raise InputError(f"the model of scene '{self.meta['scene']}' has no skin", do=do)
        return skin

    @property
    def contact_errors(self) -> tuple[ContactError, ...]:
        """Errors of the model's contact with obstacles that are kept beside its folder, one for each kind of contact
        and friction that `cfem control` has met; none of a model that was not read from a folder."""
        return self.contact_errors_source()

    @property
    def facets(self) -> np.ndarray:
        """Triangles (t, 3) of the surface, normals outward: numbers of nodes as `shape` has them."""
        return self.skin.triangles

    def shape(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        """Positions (..., m, 3) mm of all surface nodes where the actuators stand at delta_a (..., n_a) mm; p (n_p,) or
        (..., n_p). InputError where the model has no skin, or one of another geometry than p's; NumericalError far
        outside the domain."""
        return self.skin.surface(self._skin_rows(delta_a, p))

    def all_nodes(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> np.ndarray:
        """Positions (..., n, 3) mm of all nodes, inside and outside, in the order of the mesh; otherwise as
        `shape`. InputError where the samples had the surface alone."""
        return self.skin.all_nodes(self._skin_rows(delta_a, p))

    def _skin_rows(self, delta_a: ArrayLike, p: ArrayLike | None) -> np.ndarray:
        moved = [parameter.name for parameter in self.parameters if parameter.moves_body]
        if p is not None and moved:
            what = f"the shape of other designs is not known: '{moved[0]}' changes where the surface rests"
            raise InputError(what, do="leave the parameters out, for the scene's own design")
        inputs = self.learned_inputs(delta_a, self._known(p))
        self._demand_near(np.asarray(delta_a, float), *self.domain.delta_a, "displacements", 0)
        return self.skin.rows(*inputs)

    def whole(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """The condensed robot at displacements, with the rows of the skin between effectors and actuators."""
        softer = float(self.softer(self._p(p))) if self.parameters else 1.0
        return self.skin.joined(self.at_displacement(delta_a, p), *self.learned_inputs(delta_a, p), softer)

    def learned_inputs(self, delta_a: ArrayLike, p: ArrayLike | None) -> tuple[np.ndarray, np.ndarray]:
        """Inputs s (..., n_a) of the form at the reference of exact parameters, and q (..., n_q), at displacements."""
        s = np.asarray(delta_a, float)
        if s.shape[-1:] != (self.rows.n_a,) or not np.isfinite(s).all():
            raise self._not_one_each(delta_a, "a state of displacements")
        p = np.broadcast_to(self._p(p), (*s.shape[:-1], len(self.parameters)))
        if self.form == "force":
            s = self.at_displacement(s, p).lambda_a * self.softer(p)[..., None]
        return s, self.q(p)

    def tip_error_of_mesh(self, delta_e: ArrayLike) -> tuple[float, float] | None:
        """Smallest and largest error, mm, that the mesh of the samples makes where the effectors have moved by delta_e
        (n_e,), orientations left out; None where nobody has estimated it."""
        places = [not name.split(".")[-1].startswith("r") for name in self.rows.effectors]
        travel = float(np.linalg.norm(np.asarray(delta_e, float)[places]))
        return None if self.mesh_error is None else self.mesh_error.tip.bounds(travel)

    def error(self, state: Condensed, p: ArrayLike | None = None) -> StateError | None:
        """Bounds of the model's own error at states found with it, which hold with the stated probability; infinite
        outside its domain. None where the model states none."""
        return state_error(self, _state(state), p)

    def load_error(self, delta_a: np.ndarray) -> np.ndarray | float | None:
        """Error of the tip (...,), mm, by loads that the samples did not carry, at displacements (..., n_a). 95 % of
        cases do not exceed it; None where there are no loads."""
        error = self.meta.get("wrench_error")
        return error if error is None or self.meta.get("patch_loads") else LOADS * error

    @cached_property
    def christoffel(self) -> Christoffel:
        """Christoffel function of the inputs s and q: how far the model extrapolates."""
        n_a, states = self.rows.n_a, self.domain.states
        s = states[:, :n_a] if self.form == "displacement" else states[:, n_a : 2 * n_a]
        known = np.hstack([s, states[:, 2 * n_a :]])
        return Christoffel.of(known[s.any(axis=1)] if self.meta.get("untrained_rest") else known)

    @property
    def n_inputs(self) -> int:
        """Number of learned inputs: actuators, and coordinates of the parameters that are not exact."""
        return self.rows.n_a + len(self._learned)

    @abstractmethod
    def evaluate(self, s: np.ndarray, p: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """W (..., n, n) mm/N and delta_free (..., n) mm at inputs s (..., n_a), mm or N by the form, and parameters p
        (..., n_p)."""

    def softer(self, p: np.ndarray) -> np.ndarray:
        """Reference over Young's modulus (...) at parameters p (..., n_p) where its effect is exact (identity 6 of the
        condensed model: W ~ 1/E, lambda ~ E), else 1."""
        return np.prod(self._reference[self._exact] / p[..., self._exact], axis=-1)

    def softness(self, p: np.ndarray | None) -> np.ndarray | float:
        """`softer` as a column (..., 1), for the actuators."""
        return self.softer(self._p(p))[..., None] if self.parameters else 1.0

    def q(self, p: np.ndarray | None) -> np.ndarray:
        """Coordinates (..., n_q) of the parameters that are learned, at parameters p (..., n_p)."""
        p = self._p(p)
        if not self._learned:
            return p[..., :0]
        return coordinates([self.parameters[i] for i in self._learned], p[..., self._learned])

    def at(self, s: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """The condensed robot at inputs s (..., n_a) of the form; effectors from their rest position."""
        s = np.asarray(s, float)
        W, delta_free = self.evaluate(s, p)
        a = self.rows.a
        if self.form == "force":
            return Condensed(self.rows, W, delta_free, s)
        lam = np.linalg.solve(W[..., a, a], (s - delta_free[..., a])[..., None])[..., 0]
        return Condensed(self.rows, W, delta_free, lam)

    def at_displacement(self, delta_a: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """The condensed robot where its actuators stand at delta_a (..., n_a) mm. NumericalError where there is none,
        and far outside the domain."""
        delta_a, p = self._one_each(delta_a, "a state of displacements"), self._known(p)
        self._demand_near(delta_a, *self.domain.delta_a, "displacements", 0)
        return self.at(delta_a, p) if self.form == "displacement" else self._with_dual(delta_a, p)

    def ends_at_displacement(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """delta_e (n_e,) and lambda_a (n_a,) of `at_displacement`, for users who need nothing else of one state."""
        state = self.at_displacement(delta_a)
        return state.delta_e, state.lambda_a

    def at_force(self, lambda_a: ArrayLike, p: ArrayLike | None = None) -> Condensed:
        """The condensed robot under lambda_a (..., n_a) N. NumericalError where there is none, and far outside the
        domain."""
        lambda_a, p = self._one_each(lambda_a, "a state of forces"), self._known(p)
        self._demand_near(lambda_a, *(bound / self.softness(p) for bound in self.domain.lambda_a), "forces", 1)
        return self.at(lambda_a, p) if self.form == "force" else self._with_dual(lambda_a, p)

    def under_forces(self, lambda_a: np.ndarray) -> tuple[list[Condensed], np.ndarray]:
        """The condensed robot under each of lambda_a (m, n_a) N, at the scene's own parameters, and whether there is
        one (m,): the other states mean nothing."""
        p = np.broadcast_to(self._reference, (len(lambda_a), len(self.parameters)))
        if self.form == "force":
            return self.at(lambda_a, p).each(), np.ones(len(lambda_a), dtype=bool)
        states, left = self._with_duals(lambda_a, p)
        return states, left == 0

    def jacobian(self, state: Condensed) -> np.ndarray:
        """Jacobian (..., n_e, n_a) d delta_e / d delta_a = W_ea W_aa^-1 at a state found with this model. InputError
        where it is none."""
        return _state(state).effector_jacobian

    def workspace(self, states: int = 1000, seed: int = 0) -> "Workspace":
        """Places of the effectors at `states` equilibria that fill what the robot can do (workspace.py)."""
        from cfem.predict.workspace import workspace_of

        return workspace_of(self, states, seed)

    @property
    def pulls(self) -> np.ndarray:
        """Mask (n_a,) of the actuators that pull, or blow, and do not push, or suck, in the training states."""
        low, high = self.domain.lambda_a
        return low > -_PUSHES * high

    def _one_each(self, values: ArrayLike, what: str) -> np.ndarray:
        """Values as an array (..., n_a). InputError unless they are finite, one for each actuator."""
        try:
            array = np.asarray(values, float)
        except (TypeError, ValueError, OverflowError):
            raise self._not_one_each(values, what) from None
        if array.shape[-1:] != (self.rows.n_a,) or not np.isfinite(array).all():
            raise self._not_one_each(values, what)
        return array

    def _demand_near(self, states: np.ndarray, low: np.ndarray, high: np.ndarray, what: str, kind: int) -> None:
        """NumericalError where one of the states (..., n_a) lies outside the box low, high (..., n_a) of the training
        states by more than its width: the answer would be wrong by orders of magnitude. kind: 0 of displacements, 1
        of forces."""
        beyond = np.maximum(low - states, states - high)
        if beyond.max(initial=0.0) == 0.0:  # most are inside
            return
        far = (beyond > np.where(high > low, high - low, np.inf)).any(axis=-1)  # one value tells nothing of what is far
        if far.any():
            state, least, most = (np.broadcast_to(values, states.shape)[far][0] for values in (states, low, high))
            ranges = ", ".join(
                f"{name} {least:.3g} to {most:.3g}"
                for name, least, most in zip(self.rows.actuators, least, most, strict=True)
            )
            unit = " or ".join(dict.fromkeys(units[kind] for units in self.actuator_units))
            raise NumericalError(
                f"{what} {np.round(state, 6).tolist()} {unit} are far outside what the model was trained on ({ranges})",
                do="ask inside, or sample a larger space and train again",
            )

    def _not_one_each(self, values: ArrayLike, what: str) -> InputError:
        names, text = ", ".join(self.rows.actuators), repr(values)
        shown = text if len(text) <= 80 else f"{text[:77]}..."
        return InputError(f"{what} is one finite number for each actuator ({names}); got {shown}")

    def _with_dual(self, wanted: np.ndarray, p: np.ndarray | None) -> Condensed:
        """States whose forces are `wanted` (..., n_a), or displacements for the form 'force'. NumericalError where one
        is not found."""
        rows = wanted.reshape(-1, wanted.shape[-1])
        every = np.broadcast_to(self._p(p), (*wanted.shape[:-1], len(self.parameters)))
        states, left = self._with_duals(rows, every.reshape(len(rows), -1))
        demand_found(self.form, rows, left)
        batch = Condensed.batch(states)
        arrays = (batch.W, batch.delta_free, batch.lam)
        return Condensed(self.rows, *(array.reshape(*wanted.shape[:-1], *array.shape[1:]) for array in arrays))

    def _with_duals(self, wanted: np.ndarray, p: np.ndarray) -> tuple[list[Condensed], np.ndarray]:
        """States (m,) of wanted (m, n_a) and p (m, n_p), each searched from the nearest training state; what is left of
        each (m,), 0 where it is found."""
        dual: Form = "force" if self.form == "displacement" else "displacement"
        # the domain's states are those of the reference of exact parameters
        softer = self.softer(p)[:, None] if self.parameters else np.ones((len(p), 1))
        asked = wanted * softer if dual == "force" else wanted
        start = np.array([self.domain.nearest(s, dual, q) for s, q in zip(asked, self.q(p), strict=True)])
        start = start if dual == "force" else start / softer

        def evaluate(inputs: np.ndarray, which: np.ndarray) -> list[Condensed]:
            return self.at(inputs, p[which]).each()

        return with_duals(evaluate, self.form, wanted, evaluate(start, np.arange(len(p))), _ROUNDING)

    def inside(self, condensed: Condensed, p: ArrayLike | None = None) -> bool | np.ndarray:
        """True for each state found with this model that is like those that it was trained on."""
        return self.domain.holds(*self.where(condensed, p))

    @property
    def trained(self) -> np.ndarray:
        """Displacements (k, n_a) of training states, spread over all of them, the middle first."""
        return self.domain.states[:, : self.rows.n_a]

    def distance(self, condensed: Condensed, p: ArrayLike | None = None) -> float | np.ndarray:
        """Distance of each state from the training states: about 1 or less among them (`Domain.distance`)."""
        return self.domain.distance(*self.where(condensed, p))

    def where(self, condensed: Condensed, p: ArrayLike | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacements, multipliers at the reference of exact parameters, and q, as the domain has them."""
        state = _state(condensed)
        return state.delta_a, state.lambda_a * self.softness(p), self.q(p)

    def __repr__(self) -> str:
        """Kind, scene, actuators with their reach, rows and parameters, for a person."""
        samples = self.meta.get("dataset", {}).get("samples", 0)
        taught = [f"{samples} training states"] if samples else []
        actuators = ", ".join(
            f"{name} {least:g} to {most:g} {unit}"
            for name, (least, most), (unit, _) in zip(
                self.rows.actuators, self.reach, self.actuator_units, strict=False
            )
        )
        varied = [f"parameters {', '.join(parameter.name for parameter in self.parameters)}"] if self.parameters else []
        parts = [f"actuators {actuators}", f"effector rows {', '.join(self.rows.effectors)}", *varied, *taught]
        return f"<{self.meta['kind']} model of '{self.meta['scene']}': {'; '.join(parts)}>"

    def _p(self, p: np.ndarray | None) -> np.ndarray:
        """Values (..., n_p) of the parameters, the reference where none are given. InputError where the count is
        wrong."""
        if p is None:
            return self._reference
        p = np.asarray(p, float)
        if p.shape[-1:] != (len(self.parameters),):
            names = ", ".join(parameter.name for parameter in self.parameters) or "none"
            raise InputError(f"{counted(p.size, 'parameter')} given, and the model has {names}")
        return p

    def _known(self, p: ArrayLike | None) -> np.ndarray | None:
        """Parameters (..., n_p) that are given. Errors as of `_p` and `demand_in_range`."""
        if p is None:
            return None
        p = self._p(p)
        demand_in_range(self.parameters, p)
        return p


def _state(state: Any) -> Any:
    """The state itself. InputError where it is none."""
    if not isinstance(state, Condensed | HolderState):
        raise InputError(f"expected a state of the model, got {state!r:.60}", do="ask model.at_displacement for one")
    return state
