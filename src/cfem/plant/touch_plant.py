"""The FE robot among obstacles and other FE robots, as the plant: patches of the surfaces touch, open, stick and slide.

Patches that are near something are contact points of the finite elements (`cfem.equilibrium.contact.surfaces`)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cfem.condensed.patches import Patches
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.law.sliding import PARTS
from cfem.contact.obstacle import ClosedMesh, Obstacle
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.pairs import numbers_of
from cfem.contact.prescribed_motion import ActuatedRobot, PrescribedMotion, stops
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.contact.surface.overlap import depth_in_itself
from cfem.core.errors import InputError
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.contact.surfaces import SurfaceScene, SurfacesState
from cfem.equilibrium.quasi_static import CONVERGED, carried_out
from cfem.equilibrium.system.problem import Problem
from cfem.plant.contact_account import ContactAccount
from cfem.plant.protocol import Changing, Command, Measurement
from cfem.predict.contact.model import LONGEST


class TouchPlant(ContactAccount):
    """`Plant` of a robot among obstacles, other robots and itself. The answer x_e has the effectors', then the forces
    on `pressed` (N) and the distances from `avoided` (mm)."""

    def __init__(
        self,
        robot: SkinnedRobot,
        obstacles: Mapping[str, Obstacle],
        pressed: Sequence[str] = (),
        avoided: Sequence[str] = (),
        mu: float = 0.0,
        courses: Mapping[str, PrescribedMotion] | None = None,
        others: Mapping[str, tuple[SkinnedRobot, ActuatedRobot]] | None = None,
        itself: tuple[str, ...] = (),
        parts: int = PARTS,
    ):
        """Robot at rest among obstacles.

        robot: that takes the commands
        obstacles: all rigid ones, by name
        pressed, avoided: names of obstacles whose force, or distance, is a row
        mu: friction
        courses: of obstacles that move (`pass_to`)
        others: robots that it meets, by name, and the courses of their actuators
        itself: the name under which the robot touches itself, or none
        parts: in which friction is followed along a step"""
        self._robot, self._obstacles, self._pressed, self._avoided = robot, obstacles, pressed, avoided
        self._courses, self._others, self._itself = courses or {}, others or {}, itself
        self._numbers, self._share, self._blocked = numbers_of(itself, self._others, obstacles), 0.0, CONVERGED
        robots = [replace(robot, itself=bool(itself)), *(soft_obstacle for soft_obstacle, _ in self._others.values())]
        self._meeting = SurfaceScene(robots, ObstacleSet(tuple(obstacles.values())), mu, parts)
        self._at, self.met = np.zeros(robot.robot.rows.n_a), None
        self._solid = tuple(name for name in obstacles if name not in avoided)
        by_patches = isinstance(robot.patches, Patches)
        super().__init__(*(() if by_patches else ("nodes", "take a finer mesh")))

    @property
    def changing(self) -> Changing:
        moved = ("_obstacles", "_meeting", "_share", "_blocked") if self._courses or self._others else ()
        return [(self, ("_at", "met", *moved, *self.COUNTED))]

    @property
    def problems(self) -> list[Problem]:
        return [skinned.problem for skinned in self._meeting.robots]

    @property
    def x(self) -> np.ndarray:
        """Nodes (n, 3) mm of the robot now."""
        return self._robot.problem.rest if self.met is None else self.met.solved[0].state.x

    def step(self, u: np.ndarray, kind: Command = "displacement") -> Measurement:
        """Measurement after displacements (n_a,) mm, in quasi-static steps; where the shortest fails the state is the
        last that converged, and the status says why."""
        self.commands += 1
        robot = self._robot.robot
        u, longest = np.asarray(u, float), self._meeting.longest[0]
        n_e = robot.rows.n_e + len(self._pressed) + len(self._avoided)
        if kind != "displacement":
            return Measurement.failed(n_e, len(u), self.commands, "contact takes displacements")
        status = carried_out(self._at, u, longest, self._short_step) if self._blocked == CONVERGED else self._blocked
        self.failures += status != CONVERGED
        if self.met is None:
            return Measurement.failed(n_e, len(u), self.commands, status)
        self.seen(self.met.modes.values(), self.met.residual / robot.length)
        solved = self.met.solved[0]
        forces = [self.met.between(0, self._numbers[name]) for name in self._pressed]
        x_e = np.concatenate([robot.rest_e + solved.delta_e, forces, self._distances(self._avoided)])
        for name, body in ({name: self._obstacles[name] for name in self._solid} | self._bodies()).items():
            self.deepest = max(self.deepest, (-self._distance(body), name))
        for name in self._itself:
            self.deepest = max(self.deepest, (self._depth_in_itself(), name))
        return Measurement(x_e, solved.delta_a, solved.lambda_a, self.commands, status)

    def pass_to(self, share: float) -> None:
        """Moves what moves to its place at this share of the run, the robot giving way with its actuators held. Where
        the robot finds no state it stays where there was one, and the next step says why."""
        self._blocked = CONVERGED
        courses = [*self._courses.values(), *(actuated for _, actuated in self._others.values())]
        for begin, end in stops(courses, self._share, share, LONGEST * self._meeting.length):
            before = self._obstacles, self._meeting, self.met, self._share
            self._obstacles = dict(self._obstacles) | {name: course.at(end) for name, course in self._courses.items()}
            obstacles = ObstacleSet(tuple(self._obstacles.values()))
            self._meeting, self._share = replace(self._meeting, obstacles=obstacles), end
            if self.met is not None:
                moving = {self._numbers[name]: course for name, course in self._courses.items()}
                memory = self.met.memory.carried(self.met.pairs, moving, begin, end)
                self.met = replace(self.met, memory=memory)
            self._blocked = self._go(self._at)
            if self._blocked != CONVERGED:
                self._obstacles, self._meeting, self.met, self._share = before
                return

    def _short_step(self, u: np.ndarray) -> str:
        return self._go(u, self._meeting.short_step)

    def _go(self, u: np.ndarray, step: Callable[..., SurfacesState] | None = None) -> str:
        """Status of one quasi-static step; step: of the scene."""
        deltas = [u, *(actuated.deltas(self._share) for _, actuated in self._others.values())]
        state = (step or self._meeting.step)(deltas, self.met)
        self.steps += 1
        self.iterations += state.iterations
        if state.converged:
            self.met, self._at = state, u
        return CONVERGED if state.converged else state.status.value

    def _distances(self, names: Sequence[str]) -> np.ndarray:
        """Distances (k,) mm of the whole surface, between the patches too, from these obstacles."""
        return np.array([self._distance(self._obstacles[name]) for name in names])

    def _bodies(self) -> dict[str, Obstacle]:
        """Bodies of the other robots as they are now, but those whose surface overlaps itself, which have no inside."""
        bodies = {}
        for (name, (skinned, _)), solved in zip(self._others.items(), self.met.solved[1:], strict=True):
            try:
                bodies[name] = ClosedMesh(ClosedSurface(skinned.surface(solved.state.x), skinned.triangles))
            except InputError:
                self.unjudged |= {name}
        return bodies

    def _depth_in_itself(self) -> float:
        """Depth mm of the surface in itself, at the nodes of points that are near others."""
        near, points = self.met.pairs.used, self._robot.patches
        tried = np.unique(points.weights[near[near < len(points)]].nonzero()[1])
        return depth_in_itself(self._robot.surface(self.x), self._robot.triangles, tried)

    def _distance(self, obstacle: Obstacle) -> float:
        return nearest_of_surface(self._robot.surface(self.x), self._robot.triangles, obstacle).distance
