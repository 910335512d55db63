"""A learned robot that touches anything with any part of its surface, at actuators that are held.

Patches p of the skin are where it may be touched. Their places follow from the modes u_k of the skin
(`cfem.predict.skin`) and from the forces f_p on them, which work on the modes by w_k = sum_p u_kp . f_p:

    x_p = X_p + sum_k u_kp s_k + sum_q L_pq f_q        s = s_0 + C_ss w        e = e_0 + C_es w

s_0, e_0 and the compliances C are the model's at delta_a. L_pq is what the modes leave of the compliance between two
patches. It is local: it falls with their distance, turns with them, and else hardly changes. Signed distances and
frames of obstacles at x_p, and the compliance of all patches that touch, make one linear contact problem
(`cfem.contact`), which is solved exactly. It is posed again where the patches have come to, until neither forces nor
the patches that touch change. The forces of the actuators follow from the energy of the loaded robot,
Psi - w . s_0 - w . C_ss w / 2 (`cfem.predict.loaded`)."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag
from scipy.spatial.transform import Rotation

from cfem.condensed.patches import Patches, cut
from cfem.contact.modes import Mode
from cfem.contact.obstacle import Obstacle
from cfem.contact.problem import ContactProblem, Law
from cfem.contact.solve import ContactStatus, solve_contact
from cfem.core.errors import InputError
from cfem.predict.protocol import Predictor

ITERATIONS = 60
TOLERANCE = 1e-9  # of the length: largest change of a patch's place between the last two rounds
MOST = 30  # patches that may touch at once
OVERLAP = 1e-6  # of the length: how far a patch may be within an obstacle
STEP = 1e-4  # of the reach: at which the compliance is differenced by delta_a


class TouchedStatus(Enum):
    """How it ended; the value is the sentence that the user reads."""

    CONVERGED = "converged"
    NO_MODE = "no combination of open, sticking and sliding patches is in equilibrium"
    ITERATIONS = "open, sticking and sliding patches keep changing: the iterations allowed were used up"
    MANY = f"more than {MOST} patches touch: take larger patches"


@dataclass(frozen=True)
class Touched:
    """One state. patches (c,): numbers of those that touch; forces (c, 3) N on them and places (c, 3) mm; gaps (c,) mm;
    modes: of each; delta_e (n_e,) mm and lambda_a (n_a,) N of the touched robot; rows (k,) mm of the
    skin, from which `LearnedSkin.surface` draws it (without what is local); stuck (N, 3) mm where friction holds each
    patch, NaN where it does not."""

    status: TouchedStatus
    patches: np.ndarray
    forces: np.ndarray
    places: np.ndarray
    gaps: np.ndarray
    modes: tuple[Mode, ...]
    delta_e: np.ndarray
    lambda_a: np.ndarray
    rows: np.ndarray
    stuck: np.ndarray
    iterations: int

    @property
    def converged(self) -> bool:
        return self.status is TouchedStatus.CONVERGED


@dataclass(frozen=True)
class Touchable:
    """A model with a skin, its patches, and their compliance (3 N, 3 N) mm/N at rest, actuators held, by finite
    elements (`cfem.equilibrium.patch_compliance`)."""

    model: Predictor
    patches: Patches
    own: np.ndarray

    def __post_init__(self) -> None:
        if self.model.form != "displacement" or self.model.parameters:
            raise InputError("contact anywhere needs a model of form displacement without parameters")
        if self.own.shape != 2 * (3 * len(self.patches),) or not np.isfinite(self.own).all():
            raise InputError(f"expected the finite compliance of {len(self.patches)} patches")

    @cached_property
    def U(self) -> np.ndarray:
        """(N, 3, k) the modes, means over patches."""
        return self.patches.mean(np.moveaxis(self.model.skin.modes, 0, -1))

    @cached_property
    def local(self) -> np.ndarray:
        """(N, N, 3, 3) mm/N what the modes leave of `own`."""
        U = self.U.reshape(len(self.own), -1)
        left = self.own - U @ self._compliance(np.zeros(self.model.rows.n_a))[1] @ U.T
        return left.reshape(len(self.patches), 3, len(self.patches), 3).swapaxes(1, 2)

    def at(
        self,
        delta_a: np.ndarray,
        obstacles: Sequence[Obstacle],
        law: Law = "coulomb",
        mu: float = 0.0,
        before: Touched | None = None,
    ) -> Touched:
        """Quasi-static step to delta_a (n_a,) mm from the state `before` (none: friction holds nothing yet). Obstacles
        stand in the frame of the robot. Never raises for numerical failure."""
        model, none = self.model, np.zeros(0)
        delta_a = np.asarray(delta_a, float)
        held = _Held(self, model.skin.rows(delta_a, none), *self._compliance(delta_a))
        stuck = np.full((len(self.patches), 3), np.nan) if before is None else before.stuck.copy()
        forces, modes, places = np.zeros_like(stuck), {}, held.places(np.zeros_like(stuck))
        status, chosen, iteration = TouchedStatus.ITERATIONS, np.zeros(0, dtype=int), 0
        while status is TouchedStatus.ITERATIONS and iteration < ITERATIONS:
            iteration += 1
            distance, frames = nearest(obstacles, places)
            chosen = np.flatnonzero((distance <= 0) | forces.any(axis=1))
            if not 0 < len(chosen) <= MOST:
                status = TouchedStatus.MANY if len(chosen) else TouchedStatus.CONVERGED
                break
            known = np.where(np.isnan(stuck[chosen]), places[chosen], stuck[chosen])
            problem, into = _posed(
                held.compliance(chosen), distance[chosen], frames[chosen], places[chosen] - known, forces[chosen], mu
            )
            answer = solve_contact(problem, law, [modes.get(number, Mode.STICK) for number in chosen.tolist()])
            if answer.status not in (ContactStatus.SOLVED, ContactStatus.SEVERAL):
                status = TouchedStatus.NO_MODE
                break
            modes = dict(zip(chosen.tolist(), answer.modes, strict=True))
            forces = np.zeros_like(forces)
            forces[chosen] = (into.T @ answer.lam).reshape(-1, 3)
            moved = held.places(forces)
            fresh = chosen[np.isnan(stuck[chosen, 0])]  # a patch that touches for the first time sticks where it came
            stuck[fresh] = moved[fresh]
            change, places = np.abs(moved - places).max(), moved
            if change <= TOLERANCE * model.length and nearest(obstacles, places)[0].min() >= -OVERLAP * model.length:
                status = TouchedStatus.CONVERGED
        for number in range(len(stuck)):
            if modes.get(number, Mode.OPEN) is not Mode.STICK:
                stuck[number] = places[number] if forces[number].any() else np.nan
        base, w = model.at_displacement(delta_a), held.work(forces)
        return Touched(
            status,
            chosen,
            forces[chosen],
            places[chosen],
            nearest(obstacles, places[chosen])[0] if len(chosen) else np.zeros(0),
            tuple(modes.get(number, Mode.OPEN) for number in chosen.tolist()),
            base.delta_e + held.C_es @ w,
            base.lambda_a - self._loads(delta_a, w),
            held.rows + held.C_ss @ w,
            stuck,
            iteration,
        )

    def _compliance(self, delta_a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.model.skin.compliance(np.asarray(delta_a, float), np.zeros(0))

    def _loads(self, delta_a: np.ndarray, w: np.ndarray) -> np.ndarray:
        """(n_a,) N: d/d delta_a of w . s_0 + w . C_ss w / 2, by which loads help the actuators."""
        help_ = w @ self.model.skin.gradient(delta_a, np.zeros(0))
        for axis in range(len(delta_a)):
            h = STEP * float(np.abs(self.model.reach[axis]).max())
            step = h * np.eye(len(delta_a))[axis]
            ahead, behind = (self._compliance(delta_a + sign * step)[1] for sign in (1, -1))
            help_[axis] += w @ (ahead - behind) @ w / (4 * h)
        return help_


class _Held:
    """The robot at one delta_a, no forces on it: rows (k,) mm of the skin; C_es (n_e, k), C_ss (k, k) mm/N."""

    def __init__(self, of: Touchable, rows: np.ndarray, C_es: np.ndarray, C_ss: np.ndarray):
        self.of, self.rows, self.C_es, self.C_ss = of, rows, C_es, C_ss
        self._surface = of.model.skin.surface(rows)
        self._free = of.patches.mean(self._surface)
        self._turns: dict[int, np.ndarray] = {}

    def work(self, forces: np.ndarray) -> np.ndarray:
        """(N, 3) N -> (k,) N: the load on the modes."""
        return np.einsum("pik,pi->k", self.of.U, forces)

    def places(self, forces: np.ndarray) -> np.ndarray:
        """(N, 3) mm."""
        found, loaded = self._free + self.of.U @ (self.C_ss @ self.work(forces)), np.flatnonzero(forces.any(axis=1))
        if len(loaded):
            found[loaded] += (self.local(loaded) @ forces[loaded].ravel()).reshape(-1, 3)
        return found

    def compliance(self, chosen: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N of the places of chosen patches."""
        U = self.of.U[chosen].reshape(3 * len(chosen), -1)
        return U @ self.C_ss @ U.T + self.local(chosen)

    def local(self, chosen: np.ndarray) -> np.ndarray:
        """(3 c, 3 c) mm/N what the modes leave, turned as the patches are, positive semidefinite."""
        turns = block_diag(*map(self._turn, chosen.tolist()))
        left = self.of.local[np.ix_(chosen, chosen)].swapaxes(1, 2).reshape(turns.shape)
        sizes, axes = np.linalg.eigh(turns @ (left + left.T) @ turns.T / 2)
        return (axes * np.maximum(sizes, 0.0)) @ axes.T

    def _turn(self, number: int) -> np.ndarray:
        """(3, 3) the rotation of a patch since rest."""
        if number not in self._turns:
            mine = self.of.patches.members[number]
            before, after = (x[mine] - x[mine].mean(axis=0) for x in (self.of.model.skin.rest, self._surface))
            self._turns[number] = Rotation.align_vectors(after, before)[0].as_matrix() if len(mine) > 2 else np.eye(3)
        return self._turns[number]


def _posed(
    compliance: np.ndarray, distance: np.ndarray, frames: np.ndarray, slip: np.ndarray, forces: np.ndarray, mu: float
) -> tuple[ContactProblem, np.ndarray]:
    """The contact problem of c points in the frames (c, 3, 3) of what they meet, `distance` (c,) from it, that have
    slipped by `slip` (c, 3) mm and carry forces (c, 3) N; (3 c, 3 c) to those frames."""
    into = block_diag(*frames)
    W = into @ compliance @ into.T
    gap = np.einsum("pij,pj->pi", frames, slip)
    gap[:, 0] = distance
    return ContactProblem((W + W.T) / 2, gap.ravel() - W @ into @ forces.ravel(), mu=mu), into


def patches_of(model: Predictor, apart: float | None = None) -> Patches:
    """The patches of a model's skin, about `apart` mm from each other, a twentieth of the length unless given."""
    return cut(model.skin.rest, model.skin.weights, apart or model.length / 20)


def nearest(obstacles: Sequence[Obstacle], points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) mm distance to the nearest obstacle, and (N, 3, 3) its frame there."""
    distances = np.array([one.distance(points) for one in obstacles])
    which = distances.argmin(axis=0)
    frames = np.array([one.frames(points) for one in obstacles])
    index = np.arange(len(points))
    return distances[which, index], frames[which, index]
