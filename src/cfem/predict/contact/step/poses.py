"""Where robots and obstacles stand in the rounds of a step: those on rigid bodies move as contact pushes these."""

import numpy as np
from numba import njit

from cfem.contact.law.newton import _modes, _newton, of_numbers
from cfem.contact.obstacle_set import ObstacleSet
from cfem.contact.patch_forces import Balance, TurningCompliance, in_frames
from cfem.contact.rigid_bodies import RigidBodies, add_wrench, carried, motions
from cfem.predict.contact.forces.loaded_robots import LoadedRobots
from cfem.predict.contact.step.bodies import Bodies
from cfem.predict.contact.step.body_yield import BodyYield, levers, moved_bodies

NO_BENDS, NO_TURNING = np.zeros((0, 3, 3)), np.zeros((0, 0))

Loads = tuple[np.ndarray, np.ndarray, np.ndarray]


class Poses:
    """Poses during one step. obstacles: where they stand now."""

    def __init__(self, scene: Bodies, robots: LoadedRobots):
        """Poses that the scene states, where nothing moves."""
        self.scene, self.robots, self.obstacles = scene, robots, scene.obstacles
        self.rigid: RigidBodies | None = scene.rigid

    def follow(self, near: np.ndarray, which: np.ndarray, push: np.ndarray) -> np.ndarray:
        """Moves rigid bodies by the forces of the robots, and push (N, 3) N of obstacles `which` (N,), of all patches,
        on patches near (d,). Places (N, 3) mm of all patches then."""
        scene, robots, rigid = self.scene, self.robots, self.rigid
        if rigid is None or not len(rigid.centres):
            return _placed(robots.places, scene.bodies, robots.R, robots.t)
        places, robots.R, robots.t, R, t = _follow(
            *(robots.places, scene.bodies, scene.R, scene.t, robots.R, robots.t, rigid.of_robots),
            *(robots.known, robots.on_known, near, which, push),
            (rigid.of_obstacles, scene.obstacles.R, scene.obstacles.t),
            (rigid.centres, rigid.mobility, rigid.before),
        )
        self.obstacles = scene.obstacles.posed(R, t)
        return places

    def yields(
        self,
        places: np.ndarray,
        near: np.ndarray,
        which: np.ndarray,
        loads: Loads,
        relative: np.ndarray | None,
        compliance: np.ndarray,
        turned: TurningCompliance | None,
    ) -> BodyYield | None:
        """Yielding of patches near (d,) obstacles `which` (N,), and then of pairs of soft surfaces, by the motion of
        rigid bodies. None where these have no motion of the first order.

        places: (N, 3) mm of all patches
        loads: forces (c, 3) N on the known patches, push (N, 3) N of obstacles on all, and which of those near turn
            their forces with the obstacles, (d,) bool
        relative (p, c): of `balance`; compliance (3 c, 3 c) mm/N: that of `turned`, where places turn forces"""
        rigid, known, d = self.rigid, self.robots.known, 3 * len(near)
        if rigid is None and turned is None:
            return BodyYield(None, None)
        at = np.searchsorted(known, near)
        B = None if relative is None else np.kron(relative, np.eye(3))
        by_pairs, turning, bends = compliance if B is None else compliance @ B.T, NO_TURNING, NO_BENDS
        if turned is not None:
            turning = turned.turning.reshape(-1, 3, 3 * len(known))[at].reshape(d, -1)
            turning, bends = turning if B is None else turning @ B.T, turned.by_place[at]
        if rigid is None:
            return BodyYield(None, turning)
        soft = np.zeros((0, len(known))) if relative is None else relative[len(near) :]
        bodies = rigid.of_robots, self.scene.bodies, rigid.of_obstacles
        of_bodies = levers(places, near, at, which, known, soft, *loads, bends, *bodies, rigid.centres)
        mobility, turns, sound = moved_bodies(of_bodies, rigid.mobility, by_pairs, turning)
        if not sound:
            return None
        if not turns.any():
            return BodyYield(mobility, None if turned is None else turning)
        moved = by_pairs[:, :d] @ turns
        mobility += moved if B is None else B @ moved
        return BodyYield(mobility, turns if turned is None else turns + turning + turning[:, :d] @ turns)

    def balance(
        self,
        frames: np.ndarray,
        gaps: np.ndarray,
        places: np.ndarray,
        near: np.ndarray,
        which: np.ndarray,
        loads: Loads,
        compliance: np.ndarray,
    ) -> tuple[Balance | None, BodyYield]:
        """`yields` and, with it, `cfem.contact.patch_forces.balance` in one compiled call, where the known patches are
        those near (d,) obstacles. No balance where Newton's method does not find it from the forces that there are."""
        scene, rigid, (forces, push, slides) = self.scene, self.rigid, loads
        local, pushes, modes, mobility, turning, sound = _balance(
            *(frames, gaps, float(scene.mu), places, near, which, self.robots.known, forces, push, slides, compliance),
            *((rigid.of_robots, scene.bodies, rigid.of_obstacles, rigid.centres), rigid.mobility),
        )
        yields = BodyYield(mobility, turning if len(turning) else None)
        if not sound:
            return None, yields
        nothing = np.zeros(pushes.shape)
        return Balance(of_numbers(modes), local, pushes, pushes, pushes - forces, compliance, nothing), yields

    def since(self, before: ObstacleSet | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]:
        """R and t of obstacles where they stood before, None: where they are, and now; whether these differ."""
        now, then = self.obstacles, self.obstacles if self.rigid is None or before is None else before
        return then.R, then.t, now.R, now.t, now is not then

    def gaps(
        self,
        frames: np.ndarray,
        places: np.ndarray,
        near: np.ndarray,
        which: np.ndarray,
        stuck: np.ndarray,
        distance: np.ndarray,
        before: ObstacleSet | None,
    ) -> np.ndarray:
        """(d, 3) mm of patches near (d,), in the frames (d, 3, 3) of obstacles `which` (N,) that are `distance` (N,) mm
        away: normal gap, and slip from where they stuck, (N, 3) mm, when obstacles stood as `before` says, None: as
        now."""
        return gaps_of(frames, places, near, which, stuck, distance, *self.since(before), float(self.scene.mu))


@njit(cache=True, error_model="numpy")
def _placed(local, bodies, R, t):
    """(N, 3) mm in the scene, of places in the frames of robots `bodies` (N,) at R (r, 3, 3) and t (r, 3) mm."""
    places = np.empty_like(local)
    for p in range(len(local)):
        _put(local, bodies, R, t, p, places[p])
    return places


@njit(cache=True, error_model="numpy")
def _put(local, bodies, R, t, p, place):
    """Puts into place (3,) mm that of a patch p, as `_placed` has it."""
    i = bodies[p]
    for a in range(3):
        place[a] = R[i, a, 0] * local[p, 0] + R[i, a, 1] * local[p, 1] + R[i, a, 2] * local[p, 2] + t[i, a]


@njit(cache=True, error_model="numpy")
def _follow(local, bodies, R, t, R_now, t_now, of_robots, known, forces, near, which, push, met, rigid):
    """Places (N, 3) mm, and poses of the robots and of the obstacles, all predicted where nothing else presses.

    local (N, 3) mm, of robots `bodies` (N,), predicted at R and t, now at R_now and t_now, on bodies of_robots (r,);
    forces (c, 3) N on known (c,) patches, of which push (N, 3) N on near (d,) are of obstacles `which` (N,); met: of
    these, the bodies (n,) that they are on, and the poses that are predicted; rigid: `centres`, `mobility` and `before`
    of `RigidBodies`."""
    (of_obstacles, R_obstacles, t_obstacles), (centres, mobility, before) = met, rigid
    place, lever = np.empty(3), np.empty(3)
    for _ in range(2 if (of_robots >= 0).any() else 1):  # once more with the levers where robots have come to
        wrench = -before
        for i in range(len(known)):
            body = of_robots[bodies[known[i]]]
            _put(local, bodies, R_now, t_now, known[i], place)
            for a in range(3):
                lever[a] = place[a] - centres[body, a]
            add_wrench(wrench, body, lever, forces[i])
        for patch in near:
            body = of_obstacles[which[patch]]
            _put(local, bodies, R_now, t_now, patch, place)
            for a in range(3):
                lever[a] = place[a] - centres[body, a]
            add_wrench(wrench, body, lever, -push[patch])
        xi = np.zeros(len(wrench))
        for a in range(len(wrench)):
            for b in range(len(wrench)):
                xi[a] += mobility[a, b] * wrench[b]
        R_body, t_body = motions(xi, centres)
        R_now, t_now = carried(of_robots, R_body, t_body, R, t)
    R_met, t_met = carried(of_obstacles, R_body, t_body, R_obstacles, t_obstacles)
    return _placed(local, bodies, R_now, t_now), R_now, t_now, R_met, t_met


@njit(cache=True, error_model="numpy")
def gaps_of(frames, places, near, which, stuck, distance, R_then, t_then, R_now, t_now, moves, mu):
    """(d, 3) mm of patches near (d,), in the frames (d, 3, 3) of obstacles `which` (N,) that are `distance` (N,) mm
    away: normal gap, and, with friction mu, slip from where they stuck, (N, 3) mm, on obstacles that move with them
    from poses then to poses now. Of all patches: places (N, 3) mm."""
    gaps, begin = np.zeros((len(near), 3)), np.empty(3)
    for i in range(len(near)):
        p, o = near[i], which[near[i]]
        gaps[i, 0] = distance[p]
        if not mu > 0:
            continue
        for a in range(3):
            begin[a] = stuck[p, a]
        if moves:
            carry(begin, R_then[o], t_then[o], R_now[o], t_now[o])
        for a in range(1, 3):
            for b in range(3):
                gaps[i, a] += frames[i, a, b] * (places[p, b] - begin[b])
    return gaps


@njit(cache=True, error_model="numpy")
def carry(point, R_then, t_then, R_now, t_now):
    """Moves a point (3,) mm of a body along, which has gone from one pose to another, in place."""
    x, y, z = point[0] - t_then[0], point[1] - t_then[1], point[2] - t_then[2]
    u = x * R_then[0, 0] + y * R_then[1, 0] + z * R_then[2, 0]
    v = x * R_then[0, 1] + y * R_then[1, 1] + z * R_then[2, 1]
    w = x * R_then[0, 2] + y * R_then[1, 2] + z * R_then[2, 2]
    for a in range(3):
        point[a] = R_now[a, 0] * u + R_now[a, 1] * v + R_now[a, 2] * w + t_now[a]


@njit(cache=True, error_model="numpy")
def _balance(frames, gaps, mu, places, near, which, known, forces, push, slides, compliance, on_bodies, Y):
    """Forces (d, 3) N in the frames (d, 3, 3) and in the scene, modes (d,), `mobility` and `turning` of `BodyYield`,
    of size 0 where nothing turns; False where there are none. For the arguments see `Poses.balance` and `levers`;
    on_bodies: its last four."""
    d, n, soft, bends = len(near), 3 * len(near), np.empty((0, len(near))), np.empty((0, 3, 3))
    of_bodies = levers(places, near, np.arange(d), which, known, soft, forces, push, slides, bends, *on_bodies)
    mobility, turning, sound = moved_bodies(of_bodies, Y, compliance, np.empty((0, 0)))
    total, turns, guess, pushes = np.empty((n, n)), False, np.zeros((d, 3)), np.zeros((d, 3))
    for i in range(n):
        for j in range(n):
            turns |= turning[i, j] != 0.0
    for i in range(n):
        for k in range(n if turns else 0):
            share = compliance[i, k]
            for j in range(n):
                mobility[i, j] += share * turning[k, j]
        for j in range(n):
            total[i, j] = compliance[i, j] + mobility[i, j]
    for i in range(d):
        for a in range(3):
            for b in range(3):
                guess[i, a] += frames[i, a, b] * push[near[i], b]
    W, free = in_frames(total, gaps, frames, guess)
    solved, _ = _newton(W, free, mu, guess)
    for i in range(d):
        for a in range(3):
            for b in range(3):
                pushes[i, a] += guess[i, b] * frames[i, b, a]
    return guess, pushes, _modes(guess, mu), mobility, turning[: n if turns else 0], sound and solved
