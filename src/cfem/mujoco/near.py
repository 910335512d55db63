"""Which points of soft robots may touch a geom: broad phase of `World`.

At a look, the distance of every point to the geoms is known. As long as nothing has moved by more than REACH, against
what it is near, only points that were as near as that may touch, and a step is one of these points
(`cfem.predict.contact.surface.surface_part`). Afterwards the motion that was is checked, by bounds: the forces and
places are those of a step of all points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numba import njit

from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.bodies import PlacedModel
from cfem.predict.contact.step.scene import ContactScene
from cfem.predict.contact.step.state import ContactState
from cfem.predict.contact.surface.surface_model import SurfaceModel
from cfem.predict.contact.surface.surface_part import SurfacePart
from cfem.predict.contact.surface.surfaces import Surfaces

REACH = 0.03  # of the length
OLD = 0.5  # of REACH: after it one looks again


@dataclass(frozen=True, eq=False)
class Look:
    """Points (n,) that may touch since a look.

    numbers: (n,) of these points among all (N)
    surfaces: of the robots, of these points alone
    state: in which everything was, None where all points may touch
    share: largest approach of a point to a geom since then (`moved`)"""

    numbers: np.ndarray
    surfaces: Surfaces
    state: ContactState | None = None
    share: float = np.inf

    @classmethod
    def nowhere(cls, surfaces: Sequence[SurfaceModel]) -> "Look":
        """All points may touch."""
        return cls(np.arange(sum(len(surface.patches) for surface in surfaces)), Surfaces(surfaces))

    def again(self, surfaces: Sequence[SurfaceModel], state: ContactState) -> "Look":
        """A look at a state of the points of this one; surfaces: whole ones of the robots."""
        numbers, parts, first, reach = [], [], 0, REACH * surfaces[0].model.length
        known = self.numbers[state.known]
        for surface, rows, (R, t) in zip(surfaces, state.rows, state.poses, strict=True):
            places = (surface.patches.rest + (surface.flat @ rows).reshape(-1, 3)) @ R.T + t
            close = (state.obstacles.nearest(places, 2 * reach)[0] <= reach) & ~surface.held_still
            close[known[(known >= first) & (known < first + len(close))] - first] = True
            numbers.append(first + np.flatnonzero(close))
            parts.append(SurfacePart(surface, np.flatnonzero(close)))
            first += len(close)
        return Look(np.concatenate(numbers), Surfaces(parts), state)

    def step(
        self, scene: ContactScene, deltas: Sequence[np.ndarray], before: ContactState | None
    ) -> tuple[ContactState, "Look"]:
        """`ContactScene.step` of a scene with whole surfaces from a state of the points of this look. The look that
        goes with the state after it."""
        surfaces = scene.surfaces
        everywhere = Look(np.arange(len(scene.bodies)), surfaces)
        if before is None or scene.soft:
            return scene.step(deltas, before), everywhere
        look, start = self, before
        if self.share > OLD:
            look = self.again(surfaces.models, before)
            start = look.taken(before, self.numbers)
        robots = [
            PlacedModel(part, robot.R, robot.t, False, robot.unilateral, robot.wrench)
            for robot, part in zip(scene.robots, look.surfaces.models, strict=True)
        ]
        state = replace(scene, robots=robots, stacked=look.surfaces).step(deltas, start)
        share = look.moved(state)
        if state.converged and share <= 1.0:
            return state, Look(look.numbers, look.surfaces, look.state, share)
        return scene.step(deltas, everywhere.taken(before, self.numbers)), everywhere

    def taken(self, state: ContactState, numbers: np.ndarray) -> ContactState:
        """A state of the points `numbers` as one of the points of this look. What it leaves out has no force on it."""
        place = np.full(max(self.numbers.max(initial=-1), numbers.max(initial=-1)) + 1, -1)
        place[self.numbers] = np.arange(len(self.numbers))
        place, count, n = place[numbers], len(numbers), len(self.numbers)
        mine, places = place >= 0, self.places(state)
        forces, stuck = np.zeros((n, 3)), np.full((n, 3), np.nan)
        for array, given in ((forces, state.forces), (places, state.places), (stuck, state.stuck)):
            array[place[mine]] = given[mine]
        pairs, relative = state.pairs, np.zeros((len(state.pairs), n))
        relative[:, place[mine]] = pairs.relative[:, mine]
        return replace(
            state,
            pairs=replace(pairs, slots=place[pairs.points] + n, relative=relative),
            bodies=self.surfaces.bodies,
            forces=forces,
            places=places,
            stuck=stuck,
            known=place[state.known],
            near=place[state.near],
            modes={int(place[slot - count]) + n: mode for slot, mode in state.modes.items()},
        )

    def places(self, state: ContactState) -> np.ndarray:
        """(n, 3) mm of the points in any state, but for what forces on them do locally."""
        surfaces, each = self.surfaces, []
        wrenches = [wrench if wrench.any() else None for wrench in state.wrenches]
        nothing = np.zeros(0, dtype=np.int64), np.zeros((len(self.numbers), 3))
        R, t = map(np.array, zip(*state.poses, strict=True))
        free = LoadedRobots(surfaces, state.deltas, wrenches, R, t, *nothing)
        for i, (model, (a, b)) in enumerate(zip(surfaces.models, pairwise(surfaces.ends), strict=True)):
            by_forces = (model.flat @ (state.rows[i] - free.held[i].rows)).reshape(-1, 3)
            each.append((free.free[a:b] + by_forces) @ R[i].T + t[i])
        return np.concatenate(each)

    def moved(self, state: ContactState) -> float:
        """Largest approach of a point to a geom since the look, as a share of REACH."""
        if self.state is None:
            return np.inf
        farthest, then, now = 0.0, self.state, state
        for i, part in enumerate(self.surfaces.models):
            surface, wrenches = part.whole, (now.wrenches[i], then.wrenches[i], part.whole.moved_by_wrench)
            by_rows = now.rows[i], then.rows[i], surface.moved_by_row
            obstacles = now.obstacles.R, now.obstacles.t, then.obstacles.R, then.obstacles.t
            approach = _approach(*obstacles, *now.poses[i], *then.poses[i], *by_rows, *wrenches, surface.size)
            farthest = max(farthest, approach)
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
