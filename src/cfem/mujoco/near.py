"""Which points of soft robots may touch a geom: broad phase of `World`.

At a look, it is known how far every point is from the geoms at least. As long as nothing has moved by more than REACH,
against what it is near, only points that were as near as that may touch, and a step is one of these points
(`cfem.predict.contact.surface.surface_part`). Afterwards the motion that was is checked, by bounds: the forces and
places are those of a step of all points. The next look asks for the distances of those points alone that this motion
may have brought near."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numba import njit

from cfem.predict.contact.forces.held_robot import held
from cfem.predict.contact.forces.loaded_robots import moved_by_wrench
from cfem.predict.contact.step.scene import ContactScene
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.surface_part import SurfacePart
from cfem.predict.contact.surface.surfaces import Surfaces

REACH = 0.03  # of the length
AHEAD = 2.0  # steps like the last one: where they may bring other points near, one looks again


@dataclass(frozen=True, eq=False)
class Look:
    """Points (n,) that may touch since a look.

    numbers: (n,) of these points among all (N)
    surfaces: of the robots, of these points alone
    apart: (N,) mm, how far all points were from geoms at least
    state: in which everything was, None where all points may touch
    share: largest approach of a point to a geom since then (`moved`)
    growth: of the share in the last step"""

    numbers: np.ndarray
    surfaces: Surfaces
    apart: np.ndarray
    state: ContactState | None = None
    share: float = np.inf
    growth: float = 0.0

    @classmethod
    def nowhere(cls, surfaces: Surfaces) -> "Look":
        """All points may touch."""
        return cls(np.arange(len(surfaces.bodies)), surfaces, np.zeros(len(surfaces.bodies)))

    def again(self, whole: Surfaces, state: ContactState) -> "Look":
        """A look at a state of the points of this one; whole: surfaces of the robots, with all points."""
        reach, parts = REACH * whole.models[0].model.length, []
        apart = self.apart if self.state is None else self.apart - self.share * reach
        asked = np.flatnonzero((apart <= reach) & ~whole.held_still)
        ends, places = np.searchsorted(asked, whole.ends).tolist(), np.empty((len(asked), 3))
        each = zip(whole.models, state.rows, state.poses, pairwise(ends), whole.ends, strict=False)
        for surface, rows, (R, t), (a, b), first in each:
            mine = asked[a:b] - first
            places[a:b] = (surface.patches.rest[mine] + surface.U[mine] @ rows) @ R.T + t
        apart = apart.copy()
        apart[asked] = state.obstacles.nearest(places)[0]
        close = (apart <= reach) & ~whole.held_still
        close[self.numbers[state.known]] = True
        numbers = np.flatnonzero(close)
        for surface, (a, b), first in zip(
            whole.models, pairwise(np.searchsorted(numbers, whole.ends).tolist()), whole.ends, strict=False
        ):
            parts.append(SurfacePart(surface, numbers[a:b] - first))
        return Look(numbers, Surfaces(parts), apart, state, 0.0, self.growth)

    def step(
        self, scene: ContactScene, deltas: Sequence[np.ndarray], before: ContactState | None
    ) -> tuple[ContactState, "Look"]:
        """`ContactScene.step` of a scene with whole surfaces from a state of the points of this look. The look that
        goes with the state after it."""
        if before is None or scene.soft:
            return scene.step(deltas, before), Look.nowhere(scene.surfaces)
        look, start = self, before
        if self.share + AHEAD * self.growth > 1.0:
            look = self.again(scene.surfaces, before)
            start = look.taken(before, self.numbers)
        state = replace(scene, stacked=look.surfaces).step(deltas, start)
        share = look.moved(state)
        if state.converged and share <= 1.0:
            growth = abs(share - look.share)
            return state, Look(look.numbers, look.surfaces, look.apart, look.state, share, growth)
        everywhere = Look.nowhere(scene.surfaces)
        return scene.step(deltas, everywhere.taken(before, self.numbers)), everywhere

    def taken(self, state: ContactState, numbers: np.ndarray) -> ContactState:
        """A state of the points `numbers` as one of the points of this look. What it leaves out has no force on it."""
        place = np.full(max(self.numbers.max(initial=-1), numbers.max(initial=-1)) + 1, -1)
        place[self.numbers] = np.arange(len(self.numbers))
        place, count, n = place[numbers], len(numbers), len(self.numbers)
        mine, places = place >= 0, self.places(state)
        forces, change, stuck = np.zeros((n, 3)), np.zeros((n, 3)), np.full((n, 3), np.nan)
        kept = (forces, state.forces), (change, state.change), (places, state.places), (stuck, state.stuck)
        for array, given in kept:
            array[place[mine]] = given[mine]
        pairs, relative = state.pairs, np.zeros((len(state.pairs), n))
        relative[:, place[mine]] = pairs.relative[:, mine]
        return replace(
            state,
            pairs=replace(pairs, slots=place[pairs.points] + n, relative=relative),
            bodies=self.surfaces.bodies,
            forces=forces,
            change=change,
            places=places,
            stuck=stuck,
            known=place[state.known],
            near=place[state.near],
            modes={int(place[slot - count]) + n: mode for slot, mode in state.modes.items()},
        )

    def places(self, state: ContactState) -> np.ndarray:
        """(n, 3) mm of the points in any state, but for what forces on them do locally."""
        each = []
        for model, rows, delta, wrench, (R, t) in zip(
            self.surfaces.models, state.rows, state.deltas, state.wrenches, state.poses, strict=True
        ):
            places = model.patches.rest + (model.flat @ rows).reshape(-1, 3)
            if wrench.any():
                places = places + moved_by_wrench(held(model, delta, wrench), model, wrench)
            each.append(places @ R.T + t)
        return np.concatenate(each)

    def moved(self, state: ContactState) -> float:
        """Largest approach of a point to a geom since the look, as a share of REACH."""
        if self.state is None:
            return np.inf
        farthest, then, now = 0.0, self.state, state
        obstacles = now.obstacles.R, now.obstacles.t, then.obstacles.R, then.obstacles.t
        for i, part in enumerate(self.surfaces.models):
            surface, poses = part.whole, (*now.poses[i], *then.poses[i])
            by_rows = now.rows[i], then.rows[i], surface.moved_by_row
            wrenches = now.wrenches[i], then.wrenches[i], surface.moved_by_wrench
            farthest = max(farthest, _approach(*obstacles, *poses, *by_rows, *wrenches, surface.size))
        return farthest / (REACH * self.surfaces.models[0].model.length)


@njit(cache=True, error_model="numpy")
def _approach(
    R,
    t,
    R_then,
    t_then,
    R_robot,
    t_robot,
    R_robot_then,
    t_robot_then,
    rows,
    rows_then,
    by_row,
    wrench,
    wrench_then,
    by_wrench,
    size,
):
    """mm by which a point of a robot may have come nearer to an obstacle, at most.

    R (n, 3, 3), t (n, 3) mm: poses of obstacles, and of the robot, now and then; rows (k,) mm and wrench (n_e,) N of
    the robot, which move a point by no more than by_row (k,) and by_wrench (n_e,) each; size: mm of the robot at
    rest"""
    by_robot, by_geoms = 0.0, 0.0
    for d in range(len(rows)):
        by_robot += abs(rows[d] - rows_then[d]) * by_row[d]
        size += abs(rows[d]) * by_row[d]
    for d in range(len(wrench)):
        by_robot += (abs(wrench[d]) + abs(wrench_then[d])) * by_wrench[d]
    for i in range(len(t)):
        turned, shifted, far = 0.0, 0.0, 0.0
        for a in range(3):  # in the frame of the robot
            place, place_then = 0.0, 0.0
            for c in range(3):
                place += (t[i, c] - t_robot[c]) * R_robot[c, a]
                place_then += (t_then[i, c] - t_robot_then[c]) * R_robot_then[c, a]
            shifted += (place - place_then) ** 2
            far += place_then**2
            for b in range(3):
                change = 0.0
                for c in range(3):
                    change += R_robot[c, a] * R[i, c, b] - R_robot_then[c, a] * R_then[i, c, b]
                turned += change**2
        by_geoms = max(by_geoms, np.sqrt(turned) * (size + np.sqrt(far)) + np.sqrt(shifted))
    return by_robot + by_geoms
