"""Inner motions of a robot of sections in a row: what moves while its actuators stand still.

Stresses s_k of the rod's elements, the same at all states in the elements' own axes, pull at it with forces
f_k = sum_elements (de/dq)^T s_k; with the actuators held it answers with G_k. As the strains of a chain of elements are
free of each other, G_k has nearly the same strain at all states, however far the robot has turned: stiffness on these
motions is constant, and mass a smooth function. The stresses are principal components, in energy, of those of the
lowest vibrations of some equilibria: what each leaves out of a vibration is of second order in its frequency."""

import numpy as np
import scipy.sparse as sp

from cfem.equilibrium.derivatives.solved import solved
from cfem.equilibrium.motion.inertia import times_mass
from cfem.equilibrium.motion.vibration import lowest_modes
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import Actuation, force, pull
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.solution import Equilibrium

STATES, MODES = 16, 3  # equilibria besides that at rest, and vibrations of each
LEAST = 1e-3  # of the strongest component's energy


def rod_stresses(problem: Problem, mass: sp.csr_array) -> np.ndarray:
    """Stresses (m, 6, k), N and N mm, of the rod's elements, of energy 1 N mm each. Depends on the robot alone.
    mass: of `mass_of`."""
    from scipy.stats import qmc  # half a second, which robots without a rod do not pay

    robot, rod = problem.robot, problem.body.rod
    n_a = robot.rows.n_a
    weights = np.sqrt(rod.stiffness / rod.length[:, None])
    seen = []
    for share in np.vstack([np.zeros(n_a), qmc.Halton(n_a, seed=0).random(STATES)]):
        equilibrium = solve(problem, _actuation(problem, share), wanted=Wanted(keep=True))
        if equilibrium.converged:
            seen.append(_strains(problem, mass, equilibrium) * weights[:, :, None])
    snapshots = np.concatenate(seen, axis=2).reshape(weights.size, -1)
    snapshots /= np.linalg.norm(snapshots, axis=0)
    U, size, _ = np.linalg.svd(snapshots, full_matrices=False)
    kept = U[:, size**2 > LEAST * size[0] ** 2]
    return kept.reshape(*weights.shape, -1) * weights[:, :, None]


def _actuation(problem: Problem, share: np.ndarray) -> Actuation:
    robot = problem.robot
    if robot.forces is not None:
        return force(robot.forces[:, 0] + share * (robot.forces[:, 1] - robot.forces[:, 0]))
    return pull(share, robot.reach[:, 1]) if share.any() else force(share)


def _strains(problem: Problem, mass: sp.csr_array, equilibrium: Equilibrium) -> np.ndarray:
    """Strains (m, 6, MODES) of the lowest vibrations about a state, the actuators held."""
    linear = equilibrium.linear
    _, shapes, _ = lowest_modes(
        lambda b: solved(linear, b)[0],
        linear.at.H[:, : problem.robot.rows.n_a],
        lambda q: times_mass(problem, mass, linear.at.x, q.reshape(problem.pattern.n_dof, -1)),
        problem.pattern.n_dof,
        MODES,
    )
    return problem.rod_strains(linear.at, shapes)
