"""A motion that begins at any positions and velocities, with the accelerations that they demand."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from cfem.equilibrium.system.actuation import Actuation
from cfem.fe_motion.problem import MovingProblem
from cfem.fe_motion.scheme import Motion
from cfem.fe_motion.start import settled_memory
from cfem.mechanics.kinematics import Kinematics


def released(problem: MovingProblem, x: np.ndarray, v: np.ndarray, actuation: Actuation, t: float = 0.0) -> Motion:
    """At positions x (n, 3) mm with velocities v (n, 3) mm/s that held nodes and rigid groups admit, with the
    accelerations of that moment. What the actuation holds is taken to stand still or to move evenly; the overstress
    begins at none."""
    x, kinematics = problem.kinematics.hold(x), problem.kinematics
    at = problem.evaluate(x, np.empty(0), actuation.load)
    actuation = actuation.padded(problem.n_active)
    centripetal = _centripetal(kinematics, x, v)
    T = kinematics.transfer_matrix(x)
    solve = splu((T.T @ sp.kron(problem.mass, sp.eye_array(3)) @ T).tocsc()).solve
    force = at.H @ actuation.offset - at.force - kinematics.reduce(x, problem.mass @ centripetal)
    HC = at.H @ actuation.C.T
    lam, accelerations = actuation.offset, solve(force[:, None])[:, 0]
    if len(actuation.C):
        by_row = solve(HC)
        held = np.linalg.solve(HC.T @ by_row, -(HC.T @ accelerations) - actuation.C @ _bent(problem, x, v, centripetal))
        lam, accelerations = lam + actuation.C.T @ held, accelerations + by_row @ held
    a = kinematics.spread(x, accelerations) + centripetal
    return Motion(t, x, v, a, a, at.pressure, lam, settled_memory(problem, x))


def _centripetal(kinematics: Kinematics, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(n, 3) mm/s^2: omega x (omega x r) of the nodes of rigid groups."""
    out = np.zeros_like(x)
    groups = kinematics.groups
    if groups is not None:
        r, relative = groups.arms(x)[1], groups.arms(v)[1]
        inertia = groups.sums((r**2).sum(axis=1)[:, None, None] * np.eye(3) - r[:, :, None] * r[:, None])
        moment = groups.sums(np.cross(r, relative))
        omega = np.linalg.solve(inertia, moment[:, :, None])[groups.owner, :, 0]
        out[groups.nodes] = np.cross(omega, np.cross(omega, r))
    return out


def _bent(problem: MovingProblem, x: np.ndarray, v: np.ndarray, centripetal: np.ndarray) -> np.ndarray:
    """(n_active,) second derivative in time of the active rows where the unknowns move evenly, by differences."""
    speed = np.abs(v).max()
    if speed == 0.0:
        return np.zeros(problem.n_active)
    h = 1e-4 * problem.robot.body.mesh.size / speed
    ahead, here, behind = (
        problem.evaluate(x + s * h * v + (s * h) ** 2 / 2 * centripetal, np.empty(0)).delta for s in (1, 0, -1)
    )
    return (ahead - 2 * here + behind) / h**2
