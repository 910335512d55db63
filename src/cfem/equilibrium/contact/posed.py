"""The contact problem of points of robots on what they meet, linear about where they are. Friction is followed along
the step that leads there (`cfem.contact.law.sliding`)."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.linalg import block_diag

from cfem.contact.law.problem import ContactProblem, Law
from cfem.contact.law.sliding import slid_on_object
from cfem.contact.law.solve import ContactSolution


class Partner(Protocol):
    """What m contact points meet, where it is now; k coordinates by which it moves by itself, 0 where its pose is
    given. Places are points of it, named by where they are in the scene before it has moved."""

    wrench: np.ndarray
    """(k,) N and N mm that it carries."""

    mobility: np.ndarray | None
    """(k,) None, or by how much what nothing balances moves it in this step, so far `gone` (k,)."""

    def surface(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (m,) mm of points (m, 3) mm, and frames (m, 3, 3) with rows n, t1, t2."""
        ...

    def motion(self, points: np.ndarray) -> np.ndarray:
        """Motion (3 m, k) of the points (m, 3) mm by its own coordinates."""
        ...

    def moved(self, xi: np.ndarray) -> "Partner":
        """The partner moved by xi (k,) mm and rad."""
        ...

    def way_to(self, other: "Partner") -> np.ndarray:
        """Motion (k,) from its pose to that of the other."""
        ...

    def now(self, places: np.ndarray) -> np.ndarray:
        """Places (m, 3) mm of the object as it is now."""
        ...

    def places(self, points: np.ndarray) -> np.ndarray:
        """Places (m, 3) mm that are at the points (m, 3) mm now."""
        ...


@dataclass(frozen=True)
class Posed:
    """The contact problem of one state.

    compliance: (3m, 3m) mm/N of the points in the scene's axes
    rotation: (3m, 3m) from those to the surface's
    force: (3m,) N on the points, in the latter
    slid: (m, 3) mm along the surface, slip of points before the last part of the step
    dragged: of what moves with a drag, how it goes without contact (k,), and by how much forces on the points hold it
    back (k, 3m); None in balance"""

    problem: ContactProblem
    compliance: np.ndarray
    rotation: np.ndarray
    force: np.ndarray
    slid: np.ndarray
    dragged: tuple[np.ndarray, np.ndarray] | None = None

    @property
    def frames(self) -> np.ndarray:
        """(m, 3, 3), blocks of `rotation`."""
        m = self.problem.m
        return self.rotation.reshape(m, 3, m, 3)[np.arange(m), :, np.arange(m)]

    def after(self, slip: np.ndarray) -> "Posed":
        """The problem of the last part of a step, points having slipped by (m, 2) mm before."""
        along = np.pad(slip, ((0, 0), (1, 0)))
        problem = replace(self.problem, free=self.problem.free - along.ravel())
        return replace(self, problem=problem, slid=(along[:, None] @ self.frames)[:, 0])

    def motion(self, answer: ContactSolution) -> np.ndarray:
        """Motion (k,) of what the points meet."""
        if self.dragged is None:
            return answer.xi
        free, held_back = self.dragged
        return free - held_back @ answer.lam


@dataclass(frozen=True)
class StepOrigin:
    """Begin of a step: points at places (m, 3) mm under push (3m,) N, both in the scene's axes, on a partner
    `around`."""

    around: Partner
    places: np.ndarray
    push: np.ndarray

    @cached_property
    def gaps(self) -> np.ndarray:
        """(m,) mm"""
        return self.around.surface(self.places)[0]

    def slid(self, posed: Posed, around: Partner, stuck: np.ndarray) -> np.ndarray:
        """Slip (m, 2) mm before the last part of the step that leads to a contact problem on the partner `around`
        (`cfem.contact.law.sliding`); stuck: see `PointsState`."""
        problem = posed.problem
        begin = np.einsum("kij,kj->ki", posed.frames, self.places - self.around.now(stuck))
        begin[:, 0] = self.gaps
        back = around.way_to(self.around) if problem.k else np.zeros(0)
        return slid_on_object(problem, begin, (posed.rotation @ self.push).reshape(-1, 3), back)


def posed_contact(
    around: Partner,
    places: np.ndarray,
    seen_from: np.ndarray,
    stuck: np.ndarray,
    compliance: np.ndarray,
    push: np.ndarray,
    law: Law,
    mu: float,
) -> Posed:
    """Contact problem of points at places (m, 3) mm with `compliance` (3m, 3m) mm/N under `push` (3m,) N, both in the
    scene's axes; seen_from (m, 3) mm: where the surface is linear about, as actuators that have moved may bring points
    deep into it. Glue holds a point at its place on the partner, on the surface or not."""
    distance, frames = around.surface(seen_from)
    distance = distance + (frames[:, 0] * (places - seen_from)).sum(axis=1)
    gap = np.einsum("kij,kj->ki", frames, places - around.now(stuck))
    if law != "bilateral":
        gap[:, 0] = distance
    rotation = block_diag(*frames)
    W, force = rotation @ compliance @ rotation.T, rotation @ push
    motion = around.motion(places)
    G, wrench = (rotation @ motion, around.wrench) if motion.shape[1] else (None, None)
    W, free = (W + W.T) / 2, gap.ravel() - W @ force
    slid = np.zeros_like(gap)
    if G is None or around.mobility is None:
        return Posed(ContactProblem(W, free, G, wrench, mu), compliance, rotation, force, slid)
    goes, held_back = around.mobility * wrench - around.gone, around.mobility[:, None] * G.T
    problem = ContactProblem(W + G @ held_back, free - G @ goes, None, None, mu)
    return Posed(problem, compliance, rotation, force, slid, (goes, held_back))
