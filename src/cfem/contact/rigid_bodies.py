"""Rigid bodies that give way to the forces of contact within one step in time.

Their poses are predicted for the end of the step, under the wrench that acted before. Another wrench moves them by

    xi = Y (wrench - before)        Y = dt^2 J M^-1 J^T

with the inertia M and the Jacobians J of their centres: what implicit Euler does. A point x of a body of centre c moves
by G xi, G = [1, -(x - c) x]. Bodies that joints connect, as the links of an arm, move each other: Y is full."""

from dataclasses import dataclass

import numpy as np
from numba import njit


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Bodies (b) of a scene. Their motions and wrenches are six numbers each, along and about the scene's axes: mm and
    rad, N and N mm.

    centres: (b, 3) mm, predicted
    mobility: (6 b, 6 b), Y
    before: (6 b,) wrench under which the poses are predicted
    of_robots, of_obstacles: (r,) and (n,) number of the body that each is fixed to; -1 of what stands still"""

    centres: np.ndarray
    mobility: np.ndarray
    before: np.ndarray
    of_robots: np.ndarray
    of_obstacles: np.ndarray

    def levers(self, bodies: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Matrix G (p, 3, 6 b) from bodies' motions to points (p, 3) mm, of bodies (p,)."""
        G = np.zeros((len(points), 3, 6 * len(self.centres)))
        for lever, body, point in zip(G, bodies, points, strict=True):
            add_lever(lever, body, point, self.centres, 1.0)
        return G


@njit(cache=True, error_model="numpy")
def carried(bodies, R, t, R_begin, t_begin):
    """Poses (n, 3, 3) and (n, 3) mm that were R_begin and t_begin, after motions x -> R x + t, R (b, 3, 3) and t (b, 3)
    mm, of the bodies (n,) to which they belong; -1: of none."""
    R_end, t_end = R_begin.copy(), t_begin.copy()
    for i in range(len(bodies)):
        body = bodies[i]
        if body < 0:
            continue
        for a in range(3):
            t_end[i, a] = t[body, a]
            for b in range(3):
                t_end[i, a] += R[body, a, b] * t_begin[i, b]
                R_end[i, a, b] = 0.0
                for d in range(3):
                    R_end[i, a, b] += R[body, a, d] * R_begin[i, d, b]
    return R_end, t_end


@njit(cache=True, error_model="numpy")
def add_wrench(wrench, body, lever, force):
    """Adds a force (3,) N at a lever (3,) mm from the centre of a body to wrench (6 b,); nothing where body is -1."""
    if body < 0:
        return
    first = 6 * body
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        wrench[first + a] += force[a]
        wrench[first + 3 + a] += lever[b] * force[c] - lever[c] * force[b]


@njit(cache=True, error_model="numpy")
def add_lever(G, body, point, centres, share):
    """Adds to G (3, 6 b) a share of the velocity of a point (3,) mm by the twist of its body; nothing where body is
    -1."""
    if body < 0:
        return
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        G[a, 6 * body + a] += share
        G[a, 6 * body + 3 + b] += share * (point[c] - centres[body, c])
        G[a, 6 * body + 3 + c] -= share * (point[b] - centres[body, b])


@njit(cache=True, error_model="numpy")
def motions(xi, centres):
    """Frames R (b, 3, 3) and places t (b, 3) mm of bodies whose centres (b, 3) mm are displaced, and which are turned
    about these, by xi (6 b,): a displacement in mm and a rotation vector in rad each."""
    R, t = np.empty((len(centres), 3, 3)), np.empty((len(centres), 3))
    for body in range(len(centres)):
        u, v = xi[6 * body : 6 * body + 3], xi[6 * body + 3 : 6 * body + 6]
        angle = np.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])  # Rodrigues: 1 + s [v] + c [v]^2
        s = np.sin(angle) / angle if angle > 1e-6 else 1 - angle * angle / 6
        half = np.sin(angle / 2) / angle if angle > 1e-6 else 0.5 - angle * angle / 48
        c = 2 * half * half
        cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        for a in range(3):
            t[body, a] = centres[body, a] + u[a]
            for b in range(3):
                square = v[a] * v[b] - (angle * angle if a == b else 0.0)
                R[body, a, b] = (1.0 if a == b else 0.0) + s * cross[a, b] + c * square
        for a in range(3):
            for b in range(3):
                t[body, a] -= R[body, a, b] * centres[body, b]
    return R, t
