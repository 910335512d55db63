"""Folded cells, loose pieces and rows that are alike are refused with their names and places."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import bar, block, hexahedra

from cfem.condensed import Rows
from cfem.core.errors import InputError
from cfem.mechanics.mesh import Mesh, tet_volumes
from cfem.robot.checks.soundness import demand_held, demand_independent, demand_unfolded, folded


def through_the_opposite_face(order=1) -> Mesh:
    """A corner node of a block pushed into it beyond the opposite face, its cells numbered so that all are positive."""
    mesh = block((2, 2, 2), (2, 2, 2), order)
    X, cells = mesh.X.copy(), mesh.cells.copy()
    corner = int(np.argmin(X.sum(axis=1)))
    X[corner] = [1.5, 1.4, 1.3]
    negative = tet_volumes(X, cells) < 0
    cells[negative] = cells[negative][:, [0, 2, 1, 3]]
    return Mesh(X, cells, mesh.facets)


def test_meshes_of_blocks_are_sound():
    for mesh in (block((3, 2, 1), (3, 2, 1), 1, 0.1), block((3, 2, 1), (3, 2, 1), 2), hexahedra((3, 2, 1), (3, 2, 1))):
        demand_unfolded(mesh, "block")
        assert not folded(mesh).any()


def test_a_node_through_the_opposite_face_is_found_though_every_volume_is_positive():
    mesh = through_the_opposite_face()
    assert (mesh.volumes > 0).all() and folded(mesh).any()
    with pytest.raises(InputError, match=r"cell \d+ at \(.*\) mm is inverted, or folded over a neighbour"):
        demand_unfolded(mesh, "block")
        assert not folded(mesh).any()


def test_an_inverted_cell_is_named_with_its_place():
    mesh = block((2, 1, 1), (2, 1, 1))
    cells = mesh.cells.copy()
    cells[3] = cells[3][[1, 0, 2, 3]]
    with pytest.raises(InputError, match="cell 3 at"):
        demand_unfolded(Mesh(mesh.X, cells, mesh.facets), "block")


def test_a_quadratic_cell_whose_middle_node_turns_it_inside_out_is_found():
    mesh = block((2, 1, 1), (2, 1, 1), 2)
    X = mesh.X.copy()
    X[mesh.cells[5, 4]] = X[mesh.cells[5, 0]] + 1.2 * (X[mesh.cells[5, 1]] - X[mesh.cells[5, 0]])
    found = folded(Mesh(X, mesh.cells, mesh.facets))
    assert found[5] and not found.all()


def test_a_loose_piece_is_named_with_size_and_place():
    robot = bar("tet4", divisions=(6, 1, 1))
    mesh = robot.body.mesh
    demand_held(robot)
    island = block((2, 2, 2), (1, 1, 1))
    both = Mesh(
        np.vstack([mesh.X, island.X + [0, 30, 0]]), np.vstack([mesh.cells, island.cells + len(mesh.X)]), mesh.facets
    )
    loose = replace(robot, body=replace(robot.body, mesh=both))
    with pytest.raises(InputError, match=r"6 cells, 2 x 2 x 2 mm large at \(1, 31, 1\) mm, is joined to nothing held"):
        demand_held(loose)
    joined = np.concatenate([[0], len(mesh.X) + np.arange(len(island.X))])
    demand_held(replace(loose, rigid=(joined,)))


def test_two_cables_alike_are_named():
    robot = bar("tet4", divisions=(6, 1, 1), cables=3)
    demand_independent(robot)
    names = Rows(robot.rows.effectors, ("left", "right", "again"))
    twice = replace(robot, rows=names, actuators=(robot.actuators[0], robot.actuators[1], robot.actuators[0]))
    with pytest.raises(InputError, match="'left', 'again' pull the body in the same way"):
        demand_independent(twice)


def test_a_cable_on_held_nodes_alone_is_named():
    robot = bar("tet4", divisions=(6, 1, 1))
    held = replace(robot, fixed=np.unique(robot.actuators[1].nodes))
    with pytest.raises(InputError, match="'cable-1' acts on held nodes alone"):
        demand_independent(held)
