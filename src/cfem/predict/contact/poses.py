"""Where robots and obstacles stand in the rounds of a step: those on rigid bodies move as contact pushes these."""

import numpy as np
from numba import njit

from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.rigid_bodies import RigidBodies, add_wrench, levers, motions
from cfem.contact.rigid_bodies import carried as poses_carried
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
        scene, robots, rigid = self.scene, self.robots, self.rigid
        local = robots.places
        if rigid is None or not len(rigid.centres):
            return _placed(local, scene.bodies, robots.R, robots.t)
        places, robots.R, robots.t, R, t = _follow(
            *(local, scene.bodies, scene.R, scene.t, robots.R, robots.t, rigid.of_robots),
            *(robots.known, robots.on_known, near, rigid.of_obstacles[which], push),
            *(rigid.centres, rigid.mobility, rigid.before),
        )
        self.obstacles = scene.obstacles.moved(rigid.of_obstacles, R, t)
        return places

    def mobility(
        self, places: np.ndarray, near: np.ndarray, which: np.ndarray, soft: np.ndarray | None
    ) -> np.ndarray | None:
        """(3 p, 3 p) mm/N: how patches near obstacles `which` (d,) yield to their forces, and then pairs of soft
        surfaces of relative (q, c) places of the known patches, by the motion of rigid bodies alone. None without."""
        if self.rigid is None:
            return None
        rigid, of_patches = self.rigid, self.rigid.of_robots[self.scene.bodies]
        G = _apart(of_patches[near], rigid.of_obstacles[which], places[near], rigid.centres)
        if soft is not None:
            known = self.robots.known
            G = np.concatenate([G, np.einsum("qc,cij->qij", soft, rigid.levers(of_patches[known], places[known]))])
        G = G.reshape(3 * len(G), G.shape[-1])
        return G @ rigid.mobility @ G.T

    def carried(self, points: np.ndarray, which: np.ndarray, before: ObstacleSet | None) -> np.ndarray:
        """(d, 3) mm where points of the surface of obstacles `which` (d,) are that were at `points` (d, 3) mm where
        these stood before."""
        if self.rigid is None or before is None:
            return points
        return _carried(points, which, before.R, before.t, self.obstacles.R, self.obstacles.t)


@njit(cache=True, error_model="numpy")
def _placed(local, bodies, R, t):
    """(N, 3) mm in the scene, of places in the frames of robots `bodies` (N,) at R (r, 3, 3) and t (r, 3) mm."""
    places = np.empty_like(local)
    for p in range(len(local)):
        i = bodies[p]
        for a in range(3):
            places[p, a] = R[i, a, 0] * local[p, 0] + R[i, a, 1] * local[p, 1] + R[i, a, 2] * local[p, 2] + t[i, a]
    return places


@njit(cache=True, error_model="numpy")
def _follow(local, bodies, R, t, R_now, t_now, of_robots, known, forces, near, met, push, centres, mobility, before):
    """Places (N, 3) mm, poses of the robots, and motions of the rigid bodies from where they are predicted.

    local (N, 3) mm, of robots `bodies` (N,), predicted at R and t, now at R_now and t_now, on bodies of_robots (r,);
    forces (c, 3) N on known (c,) patches, of which push (d, 3) N on near (d,) are of obstacles on bodies met (d,); the
    rest is of `RigidBodies`."""
    places, lever = _placed(local, bodies, R_now, t_now), np.empty(3)
    for _ in range(2 if (of_robots >= 0).any() else 1):  # once more with the levers where robots have come to
        wrench = -before
        for i in range(len(known)):
            body = of_robots[bodies[known[i]]]
            for a in range(3):
                lever[a] = places[known[i], a] - centres[body, a]
            add_wrench(wrench, body, lever, forces[i])
        for i in range(len(near)):
            for a in range(3):
                lever[a] = places[near[i], a] - centres[met[i], a]
            add_wrench(wrench, met[i], lever, -push[i])
        xi = np.zeros(len(wrench))
        for a in range(len(wrench)):
            for b in range(len(wrench)):
                xi[a] += mobility[a, b] * wrench[b]
        R_body, t_body = motions(xi, centres)
        R_now, t_now = poses_carried(of_robots, R_body, t_body, R, t)
        places = _placed(local, bodies, R_now, t_now)
    return places, R_now, t_now, R_body, t_body


@njit(cache=True, error_model="numpy")
def _apart(bodies, met, points, centres):
    """(d, 3, 6 b): G of points (d, 3) mm on bodies (d,), less that of the bodies met (d,) there."""
    return levers(bodies, points, centres) - levers(met, points, centres)


@njit(cache=True, error_model="numpy")
def _carried(points, which, R_then, t_then, R_now, t_now):
    """(d, 3) mm: points of bodies `which` (d,) that have gone from poses then to poses now."""
    result, local = np.empty((len(points), 3)), np.empty(3)
    for p in range(len(points)):
        i = which[p]
        for a in range(3):
            local[a] = 0.0
            for b in range(3):
                local[a] += (points[p, b] - t_then[i, b]) * R_then[i, b, a]
        for a in range(3):
            result[p, a] = (
                R_now[i, a, 0] * local[0] + R_now[i, a, 1] * local[1] + R_now[i, a, 2] * local[2] + t_now[i, a]
            )
    return result
