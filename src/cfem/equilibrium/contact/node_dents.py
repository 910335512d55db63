"""How forces on nodes of a surface change the compliance of these nodes and of their neighbours.

The third derivative of the energy that forces store is -E'''[z_i, z_j, z_k], with the body's energy E and the motion
z_i by a force on node i. A force strains the elements around its node most by far: these are taken, and E''' is a
central difference of their E''. What the part m_i of these motions does that is of the modes of the skin is known of
the whole body, so that only products with two factors z - m or three are taken here. Of m the elements around a node
see the rotation alone. The body has the same energy in all rotated places, which gives E''' along two rotations."""

import numpy as np
from scipy.spatial import cKDTree

from cfem.equilibrium.derivatives.third_order import STEP, steepest_of
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.body import Body, of_cells, response, tangent_form

_AXES = np.cross(np.eye(3)[:, None], np.eye(3)[None])  # [p, b] = e_p x e_b


class NodeDents:
    """Surface nodes, of numbers `nodes` (m,) in the mesh, and the elements within `near` mm of each at rest, at the
    places x (n, 3) mm. smooth (n, 3, k) mm/N: motions by loads on the modes of the skin."""

    def __init__(self, problem: Problem, nodes: np.ndarray, near: float, x: np.ndarray, smooth: np.ndarray):
        self._rest, self._body, rest = problem.rest, problem.body, problem.rest[nodes]
        self._x, self._smooth, cells = x, smooth, self._body.cells
        self._near = [np.sort(others) for others in cKDTree(rest).query_ball_point(rest, near)]
        self._cells = [
            np.isin(cells, within).any(axis=1) for within in cKDTree(self._rest).query_ball_point(rest, near)
        ]
        around = [np.unique(cells[mine]) for mine in self._cells]
        self._seen = [np.unique(np.concatenate([around[j] for j in others])) for others in self._near]
        self._moved: list[np.ndarray] = [np.zeros((0, 3, 3))] * len(nodes)

    def take(self, first: int, motions: np.ndarray) -> None:
        """Takes up motions (n, 3, 3 c) mm/N by forces on the surface nodes from `first` on."""
        for number, moved in enumerate(np.split(motions, motions.shape[2] // 3, axis=2), first):
            self._moved[number] = moved[self._seen[number]]

    def changes(self, loads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers i <= j <= k (t, 3) of surface nodes that are near each other, and the change (t, 3, 3, 3) mm/N^2 of
        the compliance of i and j with a force on k, in the axes of the motions; loads (m, k, 3) on the modes by unit
        forces."""
        triples, changes = zip(*[self._of(i, loads) for i in range(len(self._near))], strict=True)
        return np.concatenate(triples), np.concatenate(changes)

    def _of(self, i: int, loads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Those of node i and of later ones."""
        later, body = self._near[i][self._near[i] >= i], of_cells(self._body, self._cells[i])
        motions = np.zeros((*self._x.shape, 3 * len(later)))
        for place, j in enumerate(later):
            motions[self._seen[j], :, 3 * place : 3 * place + 3] = self._moved[j]
        nodes = np.unique(body.cells)
        arm = self._x[nodes] - self._x[nodes].mean(axis=0)
        turns = _rotation(arm, self._smooth[nodes]) @ np.hstack(list(loads[later]))
        E = self._third(body, motions)
        if E.any():
            E = E - self._of_turns(body, motions, nodes, arm, turns)
        j, k = np.nonzero(np.triu([np.isin(later, self._near[j]) for j in later]))
        blocks = -E.reshape(3, len(later), 3, len(later), 3)[:, j, :, k]
        return np.column_stack([np.full(len(j), i), later[j], later[k]]), blocks

    def _third(self, body: Body, motions: np.ndarray) -> np.ndarray:
        """E''' (3, c, c) along the first three of motions (n, 3, c), and two more of them."""
        third = np.zeros((3, *2 * motions.shape[2:]))
        for axis in range(3):
            steepest = steepest_of(self._rest, body.cells, motions[:, :, axis])
            if steepest > 0:
                step = STEP / steepest * motions[:, :, axis]
                ahead, behind = (
                    tangent_form(body, response(body, self._x + shift), motions) for shift in (step, -step)
                )
                third[axis] = (ahead - behind) * steepest / (2 * STEP)
        return third

    def _of_turns(
        self, body: Body, motions: np.ndarray, nodes: np.ndarray, arm: np.ndarray, turns: np.ndarray
    ) -> np.ndarray:
        """The part (3, c, c) of `_third` with two or three rotations `turns` (3, c) by the motions, of the `nodes`
        with their arms (h, 3) mm.

        With S_pq x the second derivative of a rotated place, E'''[p, q, v] = v . S_pq F - E''[S_pq x, v]."""
        S = (_AXES[:, None] @ _AXES[None] + _AXES[None] @ _AXES[:, None]).swapaxes(2, 3) / 2
        rotated = np.zeros((len(self._x), 3, 12))
        rotated[nodes, :, :3] = np.einsum("pab,na->nbp", _AXES, arm)
        rotated[nodes, :, 3:] = np.einsum("pqab,nb->napq", S, arm).reshape(-1, 3, 9)
        state, c = response(body, self._x), motions.shape[2]
        both = np.concatenate([motions, rotated], axis=2)
        stiff = tangent_form(body, state, both)[: c + 3, c + 3 :].reshape(-1, 3, 3)
        force = np.einsum("pqab,nb->napq", S, state.force[nodes])
        second = np.einsum("nav,napq->vpq", both[nodes][:, :, : c + 3], force) - stiff
        by_motion, by_turn = second[:c], second[c:]
        first = turns[:, :3]
        return (
            np.einsum("apq,pi,qj->aij", by_motion[:3], turns, turns)
            + np.einsum("ipq,pa,qj->aij", by_motion, first, turns)
            + np.einsum("jpq,pa,qi->aij", by_motion, first, turns)
            - 2 * np.einsum("rpq,ra,pi,qj->aij", by_turn, first, turns, turns)
        )


def _rotation(arm: np.ndarray, motions: np.ndarray) -> np.ndarray:
    """Rotations (3, k) that fit motions (h, 3, k) of places with arms (h, 3) about their mean best."""
    inertia = (arm**2).sum() * np.eye(3) - arm.T @ arm
    return np.linalg.solve(inertia, np.cross(arm[:, :, None], motions, axis=1).sum(axis=0))
