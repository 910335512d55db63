"""What a mesh and a robot must be for mechanics to mean something: cells that are not folded, pieces that something
holds, rows that the body can tell from each other. Each error names what it is about, and its place."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from cfem.constraint.attachment import attach
from cfem.constraint.effector import CombinedEffector, PointEffector, RotationEffector
from cfem.constraint.protocol import Watched
from cfem.core.console.shown import counted
from cfem.core.errors import InputError
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.element import shape_derivatives
from cfem.mechanics.mesh import TET_EDGES, Mesh
from cfem.robot.mesh.quality import scaled_jacobians

# Faces of a tetrahedron, each with the corner across from it.
_FACES = np.array([[1, 2, 3, 0], [0, 2, 3, 1], [0, 1, 3, 2], [0, 1, 2, 3]])
_HELD = 1e-9  # of the largest entry of a gradient
_ALIKE = 1e-10  # eigenvalue of the correlations of rows below which they are the same to rounding


def demand_unfolded(mesh: Mesh, where: str) -> None:
    """Raises InputError where cells are inverted, overlap a neighbour, or turn inside out between their nodes."""
    bad = np.flatnonzero(folded(mesh))
    if len(bad):
        cell, middle = int(bad[0]), mesh.X[mesh.cells[bad[0]]].mean(axis=0)
        more = f", as are {len(bad) - 1} more" if len(bad) > 1 else ""
        what = f"cell {cell} at {_place(middle)} is inverted, or folded over a neighbour{more}"
        raise InputError(what, where=where, do="repair the mesh there, or let cfem mesh the geometry")


def folded(mesh: Mesh) -> np.ndarray:
    """Mask (m,) of the cells that are inverted, flat, or folded over a neighbour."""
    if mesh.cells.shape[1] == 8:
        return (scaled_jacobians(mesh) <= 0).any(axis=1)
    wrong = (mesh.volumes <= 0) | _on_one_side(mesh.X, mesh.cells[:, :4])
    return wrong | _inside_out(mesh) if mesh.cells.shape[1] == 10 else wrong


def _on_one_side(X: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Mask (m,) of the cells that lie on the same side of a face as the neighbour across it."""
    faces = cells[:, _FACES].reshape(-1, 4)
    order = np.sort(faces[:, :3], axis=1)
    _, number, count = np.unique(order, axis=0, return_inverse=True, return_counts=True)
    shared = np.flatnonzero(count[number.ravel()] == 2)
    pairs = shared[np.argsort(number.ravel()[shared], kind="stable")].reshape(-1, 2)
    a, b, c = (X[order[pairs[:, 0], i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    sides = [np.einsum("ij,ij->i", normal, X[faces[pairs[:, i], 3]] - a) for i in (0, 1)]
    overlap = np.zeros(len(cells), dtype=bool)
    overlap[pairs[sides[0] * sides[1] > 0].ravel() // 4] = True
    return overlap


def _inside_out(mesh: Mesh) -> np.ndarray:
    """Mask (m,) of the cells whose quadratic map has a Jacobian of at most 0 at one of its ten nodes."""
    corners = np.eye(4)
    nodes = np.vstack([corners, corners[TET_EDGES].mean(axis=1)])
    by_barycentric = shape_derivatives(10, nodes)
    columns = np.einsum("qna,mnd->mqda", by_barycentric, mesh.X[mesh.cells])
    return (np.linalg.det(columns[..., 1:] - columns[..., :1]) <= 0).any(axis=1)


def demand_held(robot: Robot) -> None:
    """Raises InputError where a piece of the body, together with what is rigid, is joined to nothing that is held."""
    X, cells = robot.X, robot.body.mesh.cells
    groups = [np.column_stack([np.full(len(nodes) - 1, nodes[0]), nodes[1:]]) for nodes in robot.rigid]
    chains = np.concatenate([cells[:, :-1].reshape(-1, 1), cells[:, 1:].reshape(-1, 1)], axis=1)
    edges = np.concatenate([chains, *groups])
    graph = sp.coo_matrix((np.ones(len(edges)), edges.T), shape=(len(X), len(X)))
    _, piece = connected_components(graph, directed=False)
    loose = np.setdiff1d(piece[cells[:, 0]], piece[robot.fixed])
    if len(loose):
        nodes = X[piece == loose[0]]
        count = counted(int((piece[cells[:, 0]] == loose[0]).sum()), "cell")
        size = " x ".join(f"{side:.3g}" for side in np.ptp(nodes, axis=0))
        what = f"a piece of {count}, {size} mm large at {_place(nodes.mean(axis=0))}, is joined to nothing held"
        raise InputError(what, where=robot.name, do="hold it under 'fixed', join it to the rest, or leave it out")


def stands_still(robot: Robot, row: Watched) -> bool:
    """True if a row watches only held points. The nodes around such a point may be free."""
    parts = row.parts if isinstance(row, CombinedEffector) else (row,)
    points = [part for part in parts if not isinstance(part, RotationEffector)]
    return moves_nothing(robot, row) or all(isinstance(part, PointEffector) and _held(robot, part) for part in points)


def _held(robot: Robot, row: PointEffector) -> bool:
    """True if only held nodes of its element have a weight at the watched point."""
    mesh = robot.body.mesh
    cells = np.flatnonzero(np.isin(mesh.cells, row.nodes).all(axis=1))
    if len(cells) == 0:
        return False  # of a section, which `moves_nothing` knows
    attachment = attach(mesh, row.rest, 0.0, robot.name, cells)
    return not np.abs(attachment.weights[~np.isin(attachment.nodes, robot.fixed)]).max(initial=0.0) > _HELD


def moves_nothing(robot: Robot, row: Watched) -> bool:
    """True if a row acts on held nodes alone: to first order at rest, no free node changes its value."""
    if len(row.nodes) == 0:
        return False  # chambers of a rod act on its strains
    slopes = np.abs(row.gradient(robot.X))
    free = ~np.isin(row.nodes, robot.fixed)
    return not slopes[:, free].max(initial=0.0) > _HELD * slopes.max(initial=0.0)


def demand_independent(robot: Robot) -> None:
    """Raises InputError where an actuator or contact acts on nothing that can move, or where some cannot be told from
    each other because they pull the body in the same way."""
    names = [*robot.rows.actuators, *(name.rsplit(".", 1)[0] for name in robot.rows.contacts[::3])]
    pulls = [(name, row) for name, row in zip(names, robot.active, strict=True) if len(row.nodes)]
    columns, owners = [], []
    for name, row in pulls:
        if moves_nothing(robot, row):
            what = f"'{name}' acts on held nodes alone, and can move nothing"
            raise InputError(what, where=robot.name, do="lead it through the part that is free, or hold less")
        nodal = np.zeros((*robot.X.shape, len(row.rest)))
        nodal[row.nodes] = row.gradient(robot.X).transpose(1, 2, 0)
        nodal[robot.fixed] = 0.0
        columns += list(nodal.reshape(-1, len(row.rest)).T)
        owners += [name] * len(row.rest)
    if len(columns) < 2:
        return
    rows = np.array(columns)
    rows /= np.linalg.norm(rows, axis=1)[:, None]
    values, vectors = np.linalg.eigh(rows @ rows.T)  # correlations: an eigenvalue 0 is a sum of rows that vanishes
    if values[0] < _ALIKE:
        share = np.abs(vectors[:, 0])
        alike = list(dict.fromkeys(np.array(owners)[share > 0.1 * share.max()].tolist()))
        what = f"{', '.join(map(repr, alike))} pull the body in the same way: their forces cannot be told apart"
        raise InputError(what, where=robot.name, do="leave one out, or lead it along another path")


def _place(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{coordinate:.3g}" for coordinate in point) + ") mm"
