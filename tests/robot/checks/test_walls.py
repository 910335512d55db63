"""Walls of chambers that are one cell thick."""

from pathlib import Path

import numpy as np
import pytest

from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.checks.plausible import doubts
from cfem.robot.checks.walls import through_the_wall
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

BELLOWS = Path(__file__).parents[3] / "pipelines" / "bellows" / "scene.yaml"


def test_one_linear_cell_through_a_wall_is_doubted():
    """It has a third of the compliance of quadratic cells with a pressure, or less, which are not doubted."""
    doubted, compliance = {}, {}
    for element in ("tet4", "tet10p0"):
        scene = load_spec(BELLOWS, SceneSpec, [f"mesh={{size: 8 mm, element: {element}}}", "self_contact=false"])
        robot = build_robot(scene, make_mesh(scene, BELLOWS.parent)[0])
        said = "% of the cells at the wall of chamber 'chamber' reach through it, and are tet4, which cannot bend"
        doubted[element] = said in " ".join(doubts(scene, robot))
        compliance[element] = solve(Problem(robot), force(np.zeros(1))).condensed.W_aa[0, 0]
    assert doubted == {"tet4": True, "tet10p0": False} and compliance["tet4"] < compliance["tet10p0"] / 3


def test_a_wall_of_two_cells_has_none_that_reaches_through():
    """A box of points in three layers: the chamber lies below, the surface is the lowest and the highest layer."""
    layers = np.arange(12).reshape(3, 4)
    facets = np.concatenate([layers[[0, 2]][:, [0, 1, 2]], layers[[0, 2]][:, [1, 2, 3]]])
    thick = np.array([[0, 1, 2, 4], [1, 2, 3, 5], [4, 5, 6, 8]])
    thin = np.array([[0, 1, 2, 8], [1, 2, 3, 9], [0, 1, 3, 4]])
    assert through_the_wall(thick, facets, layers[0]) == 0.0
    assert through_the_wall(thin, facets, layers[0]) == pytest.approx(2 / 3)
