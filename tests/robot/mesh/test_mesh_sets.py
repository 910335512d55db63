"""Groups of a user's mesh by what they are made of, of both formats of gmsh."""

import subprocess
import sys

import meshio
import numpy as np
import pytest
from support.blocks import block

from cfem.core.errors import InputError
from cfem.robot.mesh.mesh_file import read_own

MESH = block((4, 2, 1), (4, 1, 1))
END = np.flatnonzero(MESH.X[MESH.facets, 0].max(axis=1) < 1e-9)
HALF = np.flatnonzero(MESH.X[MESH.cells].mean(axis=1)[:, 0] < 2)
INNER = np.array(
    [nodes for nodes in MESH.cells[HALF][:, [0, 1, 2]] if (np.sort(MESH.facets) != np.sort(nodes)).any(1).all()]
)


def tagged(path):
    """As gmsh writes version 2.2: one group a cell, by its tag."""
    solid, surface = np.full(len(MESH.cells), 1), np.full(len(MESH.facets), 3)
    solid[HALF], surface[END] = 2, 7
    tags = [solid, surface, np.full(len(INNER), 8), np.full(2, 9)]
    blocks = [("tetra", MESH.cells), ("triangle", MESH.facets), ("triangle", INNER), ("line", MESH.cells[:2, :2])]
    names = {"soft": [2, 3], "end": [7, 2], "inner": [8, 2], "edge": [9, 1], "nothing": [5, 2]}
    own = meshio.Mesh(
        MESH.X,
        blocks,
        cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
        field_data={name: np.array(group) for name, group in names.items()},
    )
    meshio.write(path, own, file_format="gmsh22", binary=False)
    return path


def test_groups_of_solids_of_the_boundary_and_others(tmp_path):
    own = read_own(tagged(tmp_path / "own.msh"), 1.0)
    assert (set(own.cell_sets), set(own.facet_sets), set(own.node_sets)) == ({"soft"}, {"end"}, {"inner", "edge"})
    np.testing.assert_array_equal(own.cell_sets["soft"], HALF)
    np.testing.assert_array_equal(own.facet_sets["end"], END)
    np.testing.assert_array_equal(own.node_sets["inner"], np.unique(INNER))
    np.testing.assert_array_equal(own.node_sets["edge"], np.unique(MESH.cells[:2, :2]))


def two_boxes(path, version, options="", overlapping=True):
    """Two boxes that share a face, meshed and written by gmsh itself, each volume of a group, and the far face."""
    code = f"""
import gmsh, sys
gmsh.initialize(interruptible=False)
gmsh.option.setNumber("General.Terminal", 0)
gmsh.option.setNumber("Mesh.MshFileVersion", {version})
gmsh.option.setNumber("Mesh.MeshSizeMax", 5)
{options}
occ = gmsh.model.occ
occ.fragment([(3, occ.addBox(0, 0, 0, 10, 10, 10))], [(3, occ.addBox(10, 0, 0, 10, 10, 10))])
occ.synchronize()
volumes = {{round(occ.getCenterOfMass(3, tag)[0]): tag for _, tag in gmsh.model.getEntities(3)}}
faces = [tag for _, tag in gmsh.model.getEntities(2) if occ.getCenterOfMass(2, tag)[0] > 19.9]
gmsh.model.addPhysicalGroup(3, [volumes[5]], name="soft")
gmsh.model.addPhysicalGroup(3, {"list(volumes.values())" if overlapping else "[volumes[15]]"}, name="other")
gmsh.model.addPhysicalGroup(2, faces, name="tip")
gmsh.model.mesh.generate(3)
gmsh.write(sys.argv[1])
"""
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, capture_output=True)
    return path


@pytest.mark.parametrize("version, overlapping", [(2.2, False), (4.1, False), (4.1, True)])
def test_groups_that_gmsh_wrote(tmp_path, version, overlapping, capsys):
    own = read_own(two_boxes(tmp_path / "own.msh", version, overlapping=overlapping), 1.0)
    assert own.volumes.sum() == pytest.approx(2000)
    assert own.volumes[own.cell_sets["soft"]].sum() == pytest.approx(1000)
    assert own.volumes[own.cell_sets["other"]].sum() == pytest.approx(2000 if overlapping else 1000)
    assert (own.X[own.cells[own.cell_sets["soft"]]][..., 0] <= 10).all()
    tip = own.X[own.facets[own.facet_sets["tip"]]]
    assert (tip[..., 0] == 20).all()
    area = np.linalg.norm(np.cross(tip[:, 1] - tip[:, 0], tip[:, 2] - tip[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(100)
    assert capsys.readouterr() == ("", "")


def test_sets_of_elements_that_gmsh_wrote_for_abaqus(tmp_path):
    own = read_own(two_boxes(tmp_path / "own.inp", 4.1), 1.0)
    assert own.volumes[own.cell_sets["soft"]].sum() == pytest.approx(1000)
    assert own.volumes[own.cell_sets["other"]].sum() == pytest.approx(2000)
    assert (own.X[own.facets[own.facet_sets["tip"]]][..., 0] == 20).all()


def test_what_gmsh_wrote_in_a_way_that_cannot_be_read_says_how_to_write_it(tmp_path):
    with pytest.raises(InputError, match=r"cells twice.*save it as \.msh 4\.1"):
        read_own(two_boxes(tmp_path / "own.msh", 2.2), 1.0)
    with pytest.raises(InputError, match=r"without Mesh\.SaveAll"):
        read_own(two_boxes(tmp_path / "all.msh", 4.1, 'gmsh.option.setNumber("Mesh.SaveAll", 1)'), 1.0)


def abaqus(path, sets):
    """The mesh in three blocks of elements, numbered from 101, 201 and 301: the first of no set, the others of one."""
    nodes = "".join(f"{number}, {x}, {y}, {z}\n" for number, (x, y, z) in enumerate(MESH.X.tolist(), start=11))
    parts = np.array_split(MESH.cells + 11, 3)
    blocks = [
        f"*Element, type=C3D4{title}\n"
        + "".join(f"{number}, {', '.join(map(str, cell))}\n" for number, cell in enumerate(part.tolist(), start=first))
        for title, first, part in zip(["", ", elset=rest", ", elset=Rest"], (101, 201, 301), parts, strict=True)
    ]
    path.write_text("*Heading\n** by hand\n*Node\n" + nodes + "".join(blocks) + sets)
    return path


def test_sets_of_elements_are_found_by_their_numbers_in_any_block(tmp_path):
    sets = "*Elset, elset=row, generate\n102, 104, 2\n*Elset, elset=all\nrow, 203, rest,\n*Nset, nset=Base\n11, 12\n"
    own = read_own(abaqus(tmp_path / "own.inp", sets), 1.0)
    third = len(MESH.cells) // 3
    rest = np.arange(third, len(MESH.cells))
    assert {name: cells.tolist() for name, cells in own.cell_sets.items()} == {
        "rest": rest.tolist(),
        "row": [1, 3],
        "all": [1, 3, *rest],
    }
    assert own.node_sets["Base"].tolist() == [0, 1]


@pytest.mark.parametrize("data", ["nobody", "101\nnobody"])
def test_a_set_of_elements_of_an_unknown_set_is_an_error(tmp_path, data):
    with pytest.raises(InputError, match="'nobody'"):
        read_own(abaqus(tmp_path / "own.inp", f"*Elset, elset=row\n{data}\n"), 1.0)


def test_hybrid_elements_are_cells_and_those_that_cannot_be_read_are_named(tmp_path):
    path = abaqus(tmp_path / "own.inp", "")
    text = path.read_text()
    path.write_text(text.replace("C3D4", "C3D4H"))
    assert read_own(path, 1.0).volumes.sum() == pytest.approx(8)
    path.write_text(text.replace("C3D4", "C3D99"))
    with pytest.raises(InputError, match=r"can be read: Element type not available: C3D99$"):
        read_own(path, 1.0)
