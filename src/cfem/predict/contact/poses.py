"""Where robots and obstacles stand in the rounds of a step: those on rigid bodies move as contact pushes these."""

from dataclasses import replace

import numpy as np

from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.rigid_bodies import RigidBodies
from cfem.predict.contact.bodies import Bodies
from cfem.predict.contact.loaded_robots import LoadedRobots


class Poses:
    """Poses during one step. obstacles: where they stand now."""

    def __init__(self, scene: Bodies, robots: LoadedRobots):
        """Poses that the scene states, where nothing moves."""
        self.scene, self.robots, self.obstacles = scene, robots, scene.obstacles
        self.rigid: RigidBodies | None = scene.rigid

    def follow(self, near: np.ndarray, which: np.ndarray, push: np.ndarray) -> np.ndarray:
        """Moves rigid bodies by the forces of the robots, and push (d, 3) N of obstacles `which` (d,) on patches near
        (d,). Places (N, 3) mm of all patches then."""
        places = self.robots.places()
        if self.rigid is None or not len(self.rigid.centres):
            return places
        for _ in range(1 + (self.rigid.of_robots >= 0).any()):  # once more with the levers where robots have come to
            R, t = self.rigid.motions(self._wrench(places, near, which, push))
            self.robots.placed = [
                robot if body < 0 else replace(robot, R=R[body] @ robot.R, t=R[body] @ robot.t + t[body])
                for robot, body in zip(self.scene.robots, self.rigid.of_robots.tolist(), strict=True)
            ]
            places = self.robots.places()
        self.obstacles = self.scene.obstacles.moved(self.rigid.of_obstacles, R, t)
        return places

    def _wrench(self, places: np.ndarray, near: np.ndarray, which: np.ndarray, push: np.ndarray) -> np.ndarray:
        known = self.robots.known
        wrench = np.einsum("pij,pi->j", self._of_patches(known, places), self.robots.on_known)
        return wrench - np.einsum("pij,pi->j", self.rigid.levers(self.rigid.of_obstacles[which], places[near]), push)

    def _of_patches(self, patches: np.ndarray, places: np.ndarray) -> np.ndarray:
        """(c, 3, 6 b): G of the robots' bodies at patches (c,)."""
        return self.rigid.levers(self.rigid.of_robots[self.scene.bodies[patches]], places[patches])

    def mobility(
        self, places: np.ndarray, near: np.ndarray, which: np.ndarray, soft: np.ndarray | None
    ) -> np.ndarray | None:
        """(3 p, 3 p) mm/N: how patches near obstacles `which` (d,) yield to their forces, and then pairs of soft
        surfaces of relative (q, c) places of the known patches, by the motion of rigid bodies alone. None without."""
        if self.rigid is None:
            return None
        G = self._of_patches(near, places) - self.rigid.levers(self.rigid.of_obstacles[which], places[near])
        if soft is not None:
            G = np.concatenate([G, np.einsum("qc,cij->qij", soft, self._of_patches(self.robots.known, places))])
        G = G.reshape(3 * len(G), G.shape[-1])
        return G @ self.rigid.mobility @ G.T

    def carried(self, points: np.ndarray, which: np.ndarray, before: ObstacleSet | None) -> np.ndarray:
        """(d, 3) mm where points of the surface of obstacles `which` (d,) are that were at `points` (d, 3) mm where
        these stood before."""
        if self.rigid is None or before is None:
            return points
        carried = points.copy()
        for number in np.unique(which):
            mine, begin, now = which == number, before.obstacles[number], self.obstacles.obstacles[number]
            carried[mine] = (points[mine] - begin.t) @ begin.R @ now.R.T + now.t
        return carried
