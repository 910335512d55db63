"""How every node of a body's surface yields to forces on any other, in frames that turn with the surface.

With R_i the rotation of the surface around node i since rest, the compliance of the nodes is

    C_ij = R_i (Phi_i K Phi_j^T + L_ij) R_j^T

Phi are modes of the compliance itself: the strongest of R^T C R in all states together, which random forces find
(Halko, Martinsson and Tropp, *Finding structure with randomness*, 2011). Seen in these frames both hardly change. L,
what they leave, is kept between nodes that are near each other."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from cfem.condensed.patches import SurfacePoints
from cfem.condensed.skin import Skin
from cfem.core.console.progress import progress
from cfem.equilibrium.contact.node_dents import NodeDents
from cfem.equilibrium.contact.patch_compliance import solved_at
from cfem.equilibrium.contact.skinned_robot import SkinnedRobot
from cfem.equilibrium.derivatives.third_order import skin_load_derivatives
from cfem.equilibrium.skinned import skinned
from cfem.equilibrium.system.evaluation import Evaluation, SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.surface_turns import members_of, rotations, spread

AT_ONCE = 192  # right-hand sides
OVER = 4  # random forces for each mode, all states together


@dataclass(frozen=True)
class NodeResponse:
    """Response of m surface nodes to forces on them, actuators held.

    states: (J, n_a) mm
    modes: (3 m, k) orthonormal modes of the compliance in turning frames
    by_modes: (J, k, k) mm/N, K
    tip: (J, n_e, 3 m) mm/N, motion of the effectors by the forces, in turning frames
    bent: (J, s, n_e + s, n_e + s) mm/N^2, change of the compliance of effectors and rows of the skin with loads on the
    latter
    local: (S,) numbers of the states at which L is known
    pairs: (p, 2) numbers of nodes that are near each other, the first no larger than the second
    left: (S, p, 3, 3) mm/N, L of the pairs
    triples: (t, 3) numbers of nodes that dent each other, in order
    dented: (t, 3, 3, 3) mm/N^2, change of the compliance of the first two with a force on the third, in turning
    frames"""

    states: np.ndarray
    modes: np.ndarray
    by_modes: np.ndarray
    tip: np.ndarray
    bent: np.ndarray
    local: np.ndarray
    pairs: np.ndarray
    left: np.ndarray
    triples: np.ndarray
    dented: np.ndarray

    def rounded(self) -> "NodeResponse":
        """Compliance in fewer bytes, to 5e-4 of each number: far below the error of the modes."""
        half, single = np.float16, np.float32
        return replace(
            self,
            modes=self.modes.astype(half),
            by_modes=self.by_modes.astype(single),
            tip=self.tip.astype(single),
            pairs=self.pairs.astype(np.int32),
            left=self.left.astype(half),
            triples=self.triples.astype(np.int32),
            dented=self.dented.astype(half),
        )


class _Pushed:
    """A robot at one state, under forces on its nodes: with the factor of its tangent, until another one is made.

    R: (m, 3, 3) rotations of the nodes since rest
    tip: (n_e, 3 m) mm/N, motion of the effectors by forces in turning frames"""

    def __init__(self, robot: SkinnedRobot, at: Evaluation, lam: np.ndarray, R: np.ndarray):
        """The state at, lam."""
        problem = robot.problem
        self._factor = problem.factor(at, lam, SolveCost()).factor
        self._motion, self.R = robot.motion_of_points(at.x), R
        Z = self._Z = self._factor.solve(at.H)
        self._held = np.linalg.solve(at.H.T @ Z, (self._motion.T @ Z).T)
        effectors = problem.gradients(robot.robot.effectors, at.x)
        tip = (self._motion.T @ self._factor.solve(effectors)).T - (effectors.T @ Z) @ self._held
        self.tip = (tip.reshape(-1, len(R), 1, 3) @ R).reshape(tip.shape)

    def body_moved_by(self, forces: np.ndarray) -> np.ndarray:
        """Motion (n_dof, c) of the body by forces (3 m, c) N in turning frames."""
        turned = (self.R @ forces.reshape(len(self.R), 3, -1)).reshape(forces.shape)
        return self._factor.solve(self._motion @ turned) - self._Z @ (self._held @ turned)

    def nodes_of(self, body: np.ndarray) -> np.ndarray:
        """Motion (3 m, c) mm of the nodes, in turning frames, where that of the body is (n_dof, c)."""
        moved = (self._motion.T @ body).reshape(len(self.R), 3, -1)
        return (self.R.swapaxes(1, 2) @ moved).reshape(-1, body.shape[1])

    def moved_by(self, forces: np.ndarray) -> np.ndarray:
        """Motion (3 m, c) mm of the nodes by forces (3 m, c) N, both in turning frames."""
        parts = np.split(forces, range(AT_ONCE, forces.shape[1], AT_ONCE), axis=1)
        return np.hstack([self.nodes_of(self.body_moved_by(part)) for part in parts])


def node_response(
    robot: Robot, skin: Skin, states: np.ndarray, local: np.ndarray, modes: int, near: float, denting: float
) -> NodeResponse:
    """Response of the nodes at states (J, n_a) mm, by so many modes; what these leave at the states `local` (S,),
    between nodes that are no farther than `near` mm from each other at rest; dents of nodes no farther than `denting`
    mm, at the state that is nearest to the mean. One equilibrium and two factorisations more a state, and 3 m
    right-hand sides at each of the S and for the dents. NumericalError where there is no equilibrium."""
    m, numbers = len(skin.nodes), np.arange(len(skin.nodes))
    nodes = SurfacePoints(csr_array((np.ones(m), (numbers, numbers)), shape=(m, m)), skin.rest, np.zeros(m))
    touched = SkinnedRobot(skinned(robot, skin), skin.nodes, skin.triangles, nodes, itself=False)
    members, rng, start = members_of(skin.triangles, numbers, m), np.random.default_rng(0), None
    known, samples, bent, tip, by_modes, left = [], [], [], [], [], []
    with progress("pushing all nodes of the surface by FE, in bent states", 2 * len(states)) as advance:
        for delta in states:
            moved = solved_at(touched.problem, delta, base=start)
            start, at = moved.state, moved.linear.at
            bent.append(skin_load_derivatives(moved.linear))
            R = rotations(spread(members, skin.rest, at.x[skin.nodes]))
            known.append((at, moved.linear.lam, R))
            pushed = _Pushed(touched, *known[-1])
            tip.append(pushed.tip)
            samples.append(pushed.moved_by(rng.standard_normal((3 * m, -(-OVER * modes // len(states))))))
            advance(1)
        basis = np.linalg.svd(np.concatenate(samples, axis=1), full_matrices=False)[0][:, :modes]
        pairs, middle = _pairs(skin.rest, near), np.linalg.norm(states - states.mean(axis=0), axis=1).argmin()
        for number, state in enumerate(known):
            pushed = _Pushed(touched, *state)
            K = basis.T @ pushed.moved_by(basis)
            by_modes.append((K + K.T) / 2)
            if number in local:
                left.append(_remainder(pushed, basis, by_modes[-1], pairs))
            if number == middle:
                dented = _dented(pushed, touched.problem, skin, state[0].x, denting)
            advance(1)
    stacked, single = np.stack(left).astype(np.float32), basis.astype(np.float32)
    by_state = np.stack(by_modes), np.stack(tip), np.stack(bent)
    return NodeResponse(states, single, *by_state, local, pairs, stacked, *dented)


def _pairs(rest: np.ndarray, near: float) -> np.ndarray:
    """Pairs (p, 2) of each node with itself and with those near it, in order."""
    each = np.repeat(np.arange(len(rest))[:, None], 2, axis=1)
    pairs = np.concatenate([each, cKDTree(rest).query_pairs(near, output_type="ndarray")])
    return pairs[np.lexsort(pairs.T[::-1])]


def _remainder(pushed: _Pushed, basis: np.ndarray, K: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Compliance (p, 3, 3) mm/N of pairs of nodes, less that by modes."""
    m = len(basis) // 3
    modes, by_modes = basis.reshape(m, 3, -1), (basis @ K).reshape(m, 3, -1)
    left = np.empty((len(pairs), 3, 3))
    for first, last, unit in _units(m):
        C = pushed.moved_by(unit).reshape(m, 3, last - first, 3)
        mine = slice(*np.searchsorted(pairs[:, 0], [first, last]))
        i, j = pairs[mine].T
        left[mine] = C[j, :, i - first].swapaxes(1, 2) - by_modes[i] @ modes[j].swapaxes(1, 2)
    return left


def _dented(
    pushed: _Pushed, problem: Problem, skin: Skin, x: np.ndarray, denting: float
) -> tuple[np.ndarray, np.ndarray]:
    """`NodeDents.changes` at x (n, 3) mm."""
    R, m = pushed.R, len(skin.nodes)
    on_rows = (skin.functionals.swapaxes(0, 1) @ R).swapaxes(1, 2).reshape(3 * m, -1)
    smooth = problem.kinematics.spread(x, pushed.body_moved_by(on_rows))
    dents = NodeDents(problem, skin.nodes, denting, x, smooth)
    for first, _, unit in _units(m):
        dents.take(first, problem.kinematics.spread(x, pushed.body_moved_by(unit)))
    return dents.changes(skin.modes.swapaxes(0, 1) @ R)


def _units(m: int) -> Iterator[tuple[int, int, np.ndarray]]:
    """Nodes first to last of m, and unit forces (3 m, c) N on these."""
    step = AT_ONCE // 3
    for first in range(0, m, step):
        last = min(first + step, m)
        unit = np.zeros((3 * m, 3 * (last - first)))
        unit[3 * first + np.arange(unit.shape[1]), np.arange(unit.shape[1])] = 1.0
        yield first, last, unit
