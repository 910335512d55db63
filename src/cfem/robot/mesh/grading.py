"""Mesh sizes graded so that W is as exact as a given number of cells allows.

The error of W_ij is the sum over the cells of the energy product of the errors of two response fields, those that unit
multipliers on rows i and j cause (Galerkin orthogonality; Becker and Rannacher, Acta Numerica 10, 2001). Each field's
error is estimated cell by cell from its strain less the strain smoothed over the nodes (Zienkiewicz and Zhu, IJNME 24,
1987), at rest, relative to W_ii. The size field then makes a mesh of `cells` cells whose squared errors, which go with
h^(2p) per volume, add up to the least: h^(2p + 3) ~ volume / error. p = 3/2 holds between the 2 of smooth fields and
the 1/2 near sharp notches."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cfem.core.console.progress import doing, progress
from cfem.equilibrium.system.evaluation import SolveCost
from cfem.equilibrium.system.problem import Problem
from cfem.equilibrium.system.robot import Robot
from cfem.mechanics.element import shape
from cfem.mechanics.mesh import Mesh
from cfem.mechanics.solid import Solid
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import Grading, make_mesh
from cfem.robot.spec import SceneSpec

PASSES = 4
_P = 1.5
# A regular tetrahedron of edge h has the volume h^3 / 8.485.
_REGULAR = 6 * np.sqrt(2)


@dataclass(frozen=True)
class Errors:
    """Estimated errors of W, cell by cell."""

    cells: np.ndarray  # (m, n_nodes)
    volumes: np.ndarray  # (m,) mm^3
    squared: np.ndarray  # (m,) squared errors of the response fields, each relative to its W_ii, summed over the rows


def graded_mesh(scene: SceneSpec, folder: Path) -> tuple[Mesh, float | None]:
    """The scene's mesh and CAD volume, graded where the scene states a number of cells."""
    doing("meshing")
    mesh, volume = make_mesh(scene, folder)
    if scene.mesh.cells is None:
        return mesh, volume
    with progress("meshing finest where it matters", PASSES) as advance:
        for _ in range(PASSES):
            errors = estimate(build_robot(scene, mesh))
            mesh, volume = make_mesh(scene, folder, grade(mesh, errors, scene.mesh.cells, scene.mesh.size))
            advance(1)
    return mesh, volume


def estimate(robot: Robot) -> Errors:
    """Errors of all rows of W at rest. Raises SingularMatrixError where nothing holds the robot."""
    problem = Problem(robot)
    rest = problem.evaluate(problem.rest, np.empty(0))
    B = np.hstack([problem.gradients(robot.effectors, rest.x), rest.H])
    Z = problem.factor(rest, np.zeros(problem.n_active), SolveCost()).factor.solve(B)  # response fields
    W = np.einsum("ij,ij->j", B, Z)
    squared = [np.zeros(len(part.cells)) for part in problem.body.solids]
    for j in np.flatnonzero(W > 0):
        field = problem.kinematics.spread(rest.x, Z[:, j])
        for part_squared, part in zip(squared, problem.body.solids, strict=True):
            part_squared += _smoothing_error(part, field) / W[j]
    volumes = np.concatenate([part.volumes for part in problem.body.solids])
    return Errors(problem.body.cells, volumes, np.concatenate(squared))


def _smoothing_error(part: Solid, field: np.ndarray) -> np.ndarray:
    """Energies (m,) N mm of the error of a displacement field (n, 3) within one region: 2 mu int |smoothed strain -
    strain|^2."""
    element, corners = part.element, part.cells[:, :4]
    G = np.einsum("mqnd,mni->mqid", part.gradients[:, :, : element.n_nodes], field[part.cells])
    strain = (G + G.transpose(0, 1, 3, 2)) / 2
    to_points = shape(4, element.points)  # (q, 4): strains are linear within a cell
    at_corners = np.einsum("cq,mqid->mcid", np.linalg.pinv(to_points), strain)
    smooth, weight = np.zeros((len(field), 3, 3)), np.zeros(len(field))
    np.add.at(smooth, corners, part.volumes[:, None, None, None] * at_corners)
    np.add.at(weight, corners, part.volumes[:, None])
    smooth /= np.maximum(weight, np.finfo(float).tiny)[:, None, None]
    difference = np.einsum("qc,mcid->mqid", to_points, smooth[corners]) - strain
    return 2 * part.shear * part.volumes * (difference**2).sum(axis=(2, 3)).mean(axis=1)


def grade(mesh: Mesh, errors: Errors, cells: int, largest: float) -> Grading:
    """Sizes at the corners of `mesh` for a mesh of about `cells` cells, none above `largest` mm. From pass to pass no
    size changes by more than a factor of three, for estimates on coarse meshes are rough."""
    h = (_REGULAR * errors.volumes) ** (1 / 3)
    density = np.maximum(errors.squared / errors.volumes, 1e-12 * (errors.squared.sum() / errors.volumes.sum()))
    wanted = (h ** (2 * _P) / density) ** (1 / (2 * _P + 3))

    def sizes(scale: float) -> np.ndarray:
        return np.clip(scale * wanted, h / 3, np.minimum(3 * h, largest))

    # bisection for the scale at which the sizes make `cells` cells
    low, high = 1e-12 * h.min() / wanted.max(), 1e12 * h.max() / wanted.min()
    for _ in range(200):
        middle = np.sqrt(low * high)
        too_many = (_REGULAR * errors.volumes / sizes(middle) ** 3).sum() > cells
        low, high = (middle, high) if too_many else (low, middle)
    corners = errors.cells[:, :4]
    total, weight = np.zeros(len(mesh.X)), np.zeros(len(mesh.X))
    np.add.at(total, corners, (errors.volumes * np.log(sizes(high)))[:, None])
    np.add.at(weight, corners, errors.volumes[:, None])
    nodal = np.where(weight > 0, np.exp(total / np.maximum(weight, np.finfo(float).tiny)), largest)
    return Grading(mesh, nodal)
