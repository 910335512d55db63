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
        each = zip(whole.models, state.rows, state.R, state.t, pairwise(ends), whole.ends, strict=False)
        for surface, rows, R, t, (a, b), first in each:
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
        state = scene.changed(surfaces=look.surfaces).step(deltas, start)
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
        forces, change, stuck, sticks = np.zeros((n, 3)), np.zeros((n, 3)), np.full((n, 3), np.nan), np.zeros(n, bool)
        kept = (forces, state.forces), (change, state.change), (places, state.places), (stuck, state.stuck)
        kept = *kept, (sticks, state.sticks)
        for array, given in kept:
            array[place[mine]] = given[mine]
        pairs, relative = state.pairs, np.zeros((len(state.pairs), n))
        relative[:, place[mine]] = pairs.relative[:, mine]
        return replace(
            state,
            pairs=replace(pairs, slots=place[pairs.points] + n, relative=relative),
            bodies=self.surfaces.bodies,
            surfaces=self.surfaces,
            sticks=sticks,
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
        for model, rows, delta, wrench, R, t in zip(
            self.surfaces.models, state.rows, state.deltas, state.wrenches, state.R, state.t, strict=True
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
        then, surfaces, poses = self.state, self.surfaces, []
        for moment in (state, then):
            obstacles, wrenches = moment.obstacles, moment.given[len(moment.pull) :]
            poses.append((obstacles.R, obstacles.t, moment.R, moment.t, moment.answers.rows, wrenches))
        return _approach(*poses, surfaces.shapes, surfaces.moved_at_most) / (REACH * surfaces.models[0].model.length)


@njit(cache=True, error_model="numpy")
def _approach(now, then, shapes, at_most):
    """mm by which a point of a robot (r,) may have come nearer to an obstacle, at most.

    now, then: R (n, 3, 3), t (n, 3) mm of obstacles, R (r, 3, 3), t (r, 3) mm, rows (sum of k,) mm and wrenches (sum of
        n_e,) N of robots
    shapes, at_most: of `Surfaces`"""
    (R, t, R_robots, t_robots, rows, wrenches), (sizes, by_row, by_wrench) = now, at_most
    R_then, t_then, R_robots_then, t_robots_then, rows_then, wrenches_then = then
    farthest, d, e = 0.0, 0, 0
    for robot in range(len(shapes)):
        by_robot, by_geoms, size = 0.0, 0.0, sizes[robot]
        for _ in range(shapes[robot, 1]):
            by_robot += abs(rows[d] - rows_then[d]) * by_row[d]
            size += abs(rows[d]) * by_row[d]
            d += 1
        for _ in range(shapes[robot, 3]):
            by_robot += (abs(wrenches[e]) + abs(wrenches_then[e])) * by_wrench[e]
            e += 1
        for i in range(len(t)):
            turned, shifted, far = 0.0, 0.0, 0.0
            for a in range(3):  # in the frame of the robot
                place, place_then = 0.0, 0.0
                for c in range(3):
                    place += (t[i, c] - t_robots[robot, c]) * R_robots[robot, c, a]
                    place_then += (t_then[i, c] - t_robots_then[robot, c]) * R_robots_then[robot, c, a]
                shifted += (place - place_then) ** 2
                far += place_then**2
                for b in range(3):
                    change = 0.0
                    for c in range(3):
                        change += R_robots[robot, c, a] * R[i, c, b] - R_robots_then[robot, c, a] * R_then[i, c, b]
                    turned += change**2
            by_geoms = max(by_geoms, np.sqrt(turned) * (size + np.sqrt(far)) + np.sqrt(shifted))
        farthest = max(farthest, by_robot + by_geoms)
    return farthest
