"""The FE robot among obstacles, as the plant: patches of its surface touch them, open, stick and slide.

Patches that are near an obstacle are contact points of the finite elements. After each quasi-static step all patches
are looked at: where one that was not near has come into an obstacle, the step is done again with it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cfem.condensed.patches import Patches
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.course import Course, stops
from cfem.contact.modes import Mode
from cfem.contact.obstacle import Obstacle
from cfem.contact.problem import Law
from cfem.contact.several import Several
from cfem.equilibrium.actuation import displacement
from cfem.equilibrium.held_patch import held
from cfem.equilibrium.newton import Settings
from cfem.equilibrium.patch_compliance import with_patches
from cfem.equilibrium.problem import Problem
from cfem.equilibrium.quasi_static import CONVERGED, carried_out
from cfem.equilibrium.robot import Robot
from cfem.equilibrium.solution import Equilibrium, State
from cfem.equilibrium.solve import solve
from cfem.equilibrium.touch import PlacedRobot, Touch, TouchStatus, touch
from cfem.plant.contact_account import ContactAccount
from cfem.plant.protocol import Command, Measurement
from cfem.predict.among import LONGEST, SHARE

OVERLAP = 1e-6  # of the length: how far a patch that is no contact point may be within an obstacle
NEAR = 0.6  # distances of patches: nearer to an obstacle than this a patch is a contact point
MOST = 40  # contact points
HELD = 0.9  # share of a patch's nodes that are held: it cannot touch


@dataclass(frozen=True)
class Still:
    """`Around`: obstacles that stand still, of which each point meets the nearest."""

    obstacles: Several
    wrench = np.zeros(0)

    def surface(self, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance, which = self.obstacles.nearest(at)
        return distance, self.obstacles.frames(which, at)

    def motion(self, at: np.ndarray) -> np.ndarray:
        return np.zeros((at.size, 0))

    def moved(self, xi: np.ndarray) -> "Still":
        return self

    def now(self, places: np.ndarray) -> np.ndarray:
        return places

    def places(self, at: np.ndarray) -> np.ndarray:
        return at


class TouchPlant(ContactAccount):
    """`Plant`. nodes (m,): of the surface in the mesh, which `patches` cut; triangles (t, 3) of them. obstacles: all,
    by name; the answer x_e has the effectors', then the forces on `pressed` (N) and the distances from `avoided`
    (mm). courses: of those that move (`pass_to`)."""

    def __init__(
        self,
        robot: Robot,
        patches: Patches,
        nodes: np.ndarray,
        triangles: np.ndarray,
        obstacles: Mapping[str, Obstacle],
        pressed: Sequence[str] = (),
        avoided: Sequence[str] = (),
        law: Law = "coulomb",
        mu: float = 0.0,
        courses: Mapping[str, Course] | None = None,
    ):
        self._robot, self._patches, self._nodes, self._triangles = robot, patches, nodes, triangles
        self._obstacles, self._pressed, self._avoided, self._law, self._mu = obstacles, pressed, avoided, law, mu
        self._courses, self._share, self._blocked = courses or {}, 0.0, CONVERGED
        self._around = Still(Several(tuple(obstacles.values())))
        apart = np.linalg.norm(patches.rest[:, None] - patches.rest, axis=2) + 1e9 * np.eye(len(patches))
        self._near = NEAR * float(np.median(apart.min(axis=1)))
        self._fixed = patches.mean(np.isin(nodes, robot.fixed).astype(float)) > HELD
        self._plain, self._chosen = Problem(robot), np.zeros(0, dtype=np.int64)
        self._touched: PlacedRobot | None = None
        self._last: Touch | None = None
        self.state: Equilibrium | None = None
        self._at = np.zeros(robot.rows.n_a)
        super().__init__()

    @property
    def x(self) -> np.ndarray:
        """(n, 3) mm nodes now."""
        return self._plain.rest if self.state is None else self.state.state.x

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Displacements (n_a,) mm, in quasi-static steps; where the shortest fails the state is the last one that was
        found, and the status says why."""
        self.commands += 1
        u, longest = np.asarray(u, float), SHARE * np.abs(self._robot.reach).max(axis=1)
        n_e = self._robot.rows.n_e + len(self._pressed) + len(self._avoided)
        if kind != "displacement":
            return Measurement.failed(n_e, len(u), self.commands, "contact takes displacements")
        status = carried_out(self._at, u, longest, self._go) if self._blocked == CONVERGED else self._blocked
        self.failures += status != CONVERGED
        if self.state is None:
            return Measurement.failed(n_e, len(u), self.commands, status)
        if self._last is not None:
            self.seen(self._last)
        x_e = np.concatenate([self._robot.rest_e + self.state.delta_e, self._forces(), self._distances()])
        return Measurement(x_e, self.state.delta_a, self.state.lambda_a, self.commands, status)

    def pass_to(self, share: float) -> None:
        """Obstacles that move go to where they are at this share of the run, the robot giving way with its actuators
        held. Where the robot finds no state they stay where there was one, and the next step says why."""
        self._blocked = CONVERGED
        for begin, end in stops(self._courses.values(), self._share, share, LONGEST * self._robot.length):
            before = self._obstacles, self._around, self._last
            if self._last is not None:
                self._last = replace(self._last, stuck=self._carried(begin, end))
            self._obstacles = self._obstacles | {name: one.at(end) for name, one in self._courses.items()}
            self._around = Still(Several(tuple(self._obstacles.values())))
            if self._last is not None:
                self._last = replace(self._last, around=self._around)
            self._blocked = self._go(self._at)
            if self._blocked != CONVERGED:
                self._obstacles, self._around, self._last = before
                return
            self._share = end

    def _carried(self, begin: float, end: float) -> np.ndarray:
        """(c, 3) mm the places at which contact points stick or would, where they touch what moves."""
        stuck, places = self._last.stuck.copy(), self._places()[self._chosen]
        which, touching = self._around.obstacles.nearest(places)[1], self.state.lambda_c.reshape(-1, 3).any(axis=1)
        for number, name in enumerate(self._obstacles):
            mine = (which == number) & touching
            if name in self._courses and mine.any():
                stuck[mine] = self._courses[name].carried(stuck[mine], begin, end)
        return stuck

    def _go(self, u: np.ndarray) -> str:
        """One quasi-static step."""
        begin = self.state, self._last, self._at
        while True:
            status = self._solved(u)
            if status != CONVERGED:
                self.state, self._last, self._at = begin
                return status
            distance = self._around.obstacles.nearest(self._places())[0]
            distance[self._chosen] = distance[self._fixed] = np.inf
            if distance.min(initial=np.inf) >= -OVERLAP * self._robot.length:
                self._at = u
                return CONVERGED
            more = np.flatnonzero(distance < self._near)
            self.state, self._last, self._at = begin
            if len(self._chosen) + len(more) > MOST:
                return f"more than {MOST} patches are near obstacles: take larger patches"
            self._widen(np.union1d(self._chosen, more))
            begin = self.state, self._last, self._at

    def _solved(self, u: np.ndarray) -> str:
        self.steps += 1
        if self._touched is None:
            base = None if self.state is None else self.state.state
            found = solve(self._plain, displacement(u), base=base, settings=Settings(tolerance=1e-11))
            self.iterations += 1
            if found.converged:
                self.state = found
            return found.status.value
        found = touch([self._touched], [displacement(u)], self._around, self._last, self._law, self._mu)
        self.iterations += found.iterations
        if found.converged:
            self._last, (self.state,) = found, found.solved
        return found.status.value

    def _widen(self, chosen: np.ndarray) -> None:
        """The chosen patches (c,) are contact points from here on, in the state in which the robot stands."""
        old, self._chosen = self._chosen, chosen
        robot = with_patches(self._robot, self._nodes, self._patches, chosen)
        self._touched = PlacedRobot(Problem(robot), np.eye(3), np.zeros(3))
        if self.state is None:
            return
        places, known = self._places()[chosen], np.searchsorted(chosen, old)
        lam, stuck = np.zeros((len(chosen), 3)), places.copy()
        modes = np.full(len(chosen), Mode.OPEN)
        if self._last is not None:
            lam[known], stuck[known] = self.state.lambda_c.reshape(-1, 3), self._last.stuck
            modes[known] = self._last.modes
        start = self.state.state
        start = State(start.x, start.pressure, np.concatenate([self.state.lambda_a, lam.ravel()]), start.load)
        actuation = held(displacement(self._at), (places - self._touched.points).ravel())
        found = solve(self._touched.problem, actuation, start=start, settings=Settings(tolerance=1e-11))
        self._last = Touch(TouchStatus.CONVERGED, (found,), tuple(modes), self._around, stuck, None, 0, 0)
        self.state = found

    def _places(self) -> np.ndarray:
        """(N, 3) mm of all patches."""
        return self._patches.mean(self.x[self._nodes])

    def _forces(self) -> np.ndarray:
        """(n,) N on each obstacle that is pressed."""
        names, found = list(self._obstacles), np.zeros(len(self._obstacles))
        if self._touched is not None and len(self.state.lambda_c):
            places, force = self._places()[self._chosen], self.state.lambda_c.reshape(-1, 3)
            which = self._around.obstacles.nearest(places)[1]
            normals = self._around.obstacles.frames(which, places)[:, 0]
            found = np.bincount(which, (force * normals).sum(axis=1), len(names)).astype(float)
        return np.array([found[names.index(name)] for name in self._pressed])

    def _distances(self) -> np.ndarray:
        surface = self.x[self._nodes]
        return np.array(
            [nearest_of_surface(surface, self._triangles, self._obstacles[name]).distance for name in self._avoided]
        )
