"""A user's own geometry: STL-bounded volumes, mesh files, STEP; and what goes wrong with them."""

import re
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from robot.scenes import scene
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from support.blocks import block, hexahedra

from cfem.core.errors import InputError, SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.mesh import ask_gmsh, meshing
from cfem.robot.mesh.mesh_file import write_mesh
from cfem.robot.selection import select_nodes

BOX = "{kind: box, corners: {mm: %s}}"
OTHER = "material: {young: 1 MPa, poisson: 0.3}"


def regions(*corners):
    return "[" + ", ".join(f"{{region: {BOX % own}, {OTHER}}}" for own in corners) + "]"


def volume_within(mesh, corners):
    """mm^3 of the cells that lie wholly in a box, and of those whose centroid does: equal where none straddles."""
    low, high = np.array(corners) + [[-1e-6], [1e-6]]
    X = mesh.X[mesh.cells[:, : 8 if mesh.cells.shape[1] == 8 else 4]]
    whole, centroid = ((low <= points) & (high >= points) for points in (X, X.mean(axis=1)))
    return mesh.volumes[whole.all(axis=(1, 2))].sum(), mesh.volumes[centroid.all(axis=1)].sum()


def pieces(mesh):
    """How many parts of the mesh have no node in common."""
    edges = mesh.cells[:, [[0, i] for i in range(1, mesh.cells.shape[1])]].reshape(-1, 2)
    graph = coo_array((np.ones(len(edges)), edges.T), shape=(len(mesh.X),) * 2)
    return connected_components(graph, directed=False)[0]


def box_stl(path, facets=slice(None)):
    mesh = block((3, 1, 1), (3, 1, 1))
    meshio.write(path, meshio.Mesh(mesh.X, [("triangle", mesh.facets[facets])]), binary=False)


def slot_step(path):
    """A block of 30 x 10 x 10 mm with a slot of 10 x 2 x 10 mm."""
    code = (
        "import gmsh, sys; gmsh.initialize(interruptible=False); gmsh.option.setNumber('General.Terminal', 0);"
        "occ = gmsh.model.occ; whole, slot = occ.addBox(0, 0, 0, 30, 10, 10), occ.addBox(10, 4, -1, 10, 2, 12);"
        "occ.cut([(3, whole)], [(3, slot)]);"
        "occ.synchronize(); gmsh.write(sys.argv[1]); gmsh.finalize()"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, capture_output=True)


def test_the_volume_within_a_closed_surface(tmp_path):
    box_stl(tmp_path / "box.stl")
    mesh, volume = meshing.make_mesh(scene(tmp_path, geometry="{kind: mesh-file, path: box.stl, unit: 1 cm}"), tmp_path)
    assert volume == pytest.approx(3000.0, rel=1e-6)
    assert mesh.volumes.sum() == pytest.approx(3000.0, rel=1e-9) and (mesh.volumes > 0).all()


def test_a_solid_from_a_step_file(tmp_path):
    slot_step(tmp_path / "slot.step")
    mesh, volume = meshing.make_mesh(scene(tmp_path, geometry="{kind: step, path: slot.step}"), tmp_path)
    assert volume == pytest.approx(2800.0, rel=1e-9) and mesh.volumes.sum() == pytest.approx(2800.0, rel=1e-9)


def test_an_open_surface_is_refused(tmp_path):
    box_stl(tmp_path / "open.stl", slice(2, None))
    with pytest.raises(InputError, match=r"open\.stl.*not closed"):
        meshing.make_mesh(scene(tmp_path, geometry="{kind: mesh-file, path: open.stl}"), tmp_path)


def test_a_thin_wall_whose_coarse_triangles_meet_is_filled_with_those_of_the_file(tmp_path):
    """A tube of 10 mm with a wall of 0.5 mm, in cells of 8 mm: gmsh's own surface would pass through itself."""
    around, levels = 2 * np.pi * np.arange(24) / 24, np.linspace(0, 30, 9)
    rings = [(10.0, z) for z in levels] + [(9.5, z) for z in levels[::-1]]
    X = np.vstack([np.column_stack([r * np.cos(around), r * np.sin(around), np.full(24, z)]) for r, z in rings])
    first = np.arange(len(X)).reshape(-1, 24)
    a, b = first, np.roll(first, -1, axis=1)
    c, d = np.roll(b, -1, axis=0), np.roll(a, -1, axis=0)
    triangles = np.stack([a, b, c, a, c, d], axis=2).reshape(-1, 3)
    meshio.write(tmp_path / "tube.obj", meshio.Mesh(X, [("triangle", triangles)]))
    spec = scene(tmp_path, geometry="{kind: mesh-file, path: tube.obj}", mesh="{size: 8 mm, element: tet4}")
    mesh, volume = meshing.make_mesh(spec, tmp_path)
    area = 24 / 2 * np.sin(2 * np.pi / 24) * (10**2 - 9.5**2)  # of a polygon's ring
    assert volume == pytest.approx(30 * area) and mesh.volumes.sum() == pytest.approx(volume)


def test_a_users_tetrahedra_keep_their_sets_and_are_turned_upright(tmp_path):
    mesh = block((30, 10, 10), (3, 1, 1))
    turned = mesh.cells[:, [1, 0, 2, 3]]
    flags = {"set:held": (mesh.X[:, 0] < 1e-9).astype(np.int8)}
    meshio.write(tmp_path / "own.vtu", meshio.Mesh(mesh.X, [("tetra", turned)], point_data=flags))
    ours, volume = meshing.make_mesh(scene(tmp_path, geometry="{kind: mesh-file, path: own.vtu}"), tmp_path)
    assert volume is None and (ours.volumes > 0).all()
    np.testing.assert_array_equal(ours.node_sets["held"], np.flatnonzero(mesh.X[:, 0] < 1e-9))


SIZES = {
    "of 8 m": ("{size: 8 m}", "mesh.size: cells of 8000 mm are larger than the body, 30 x 10 x 10 mm"),
    "of a hundredth": ("{size: 0.01 mm, element: tet4}", "fill a body of 30 x 10 x 10 mm with about 2.5e"),
    "of hexahedra": ("{size: 0.01 mm, element: hex8}", "with about 3.0e+09 of them"),
    "beyond a lower limit": ("{size: 5 mm, max_cells: 100}", "or allow more than mesh.max_cells: 100"),
    "of a box": (
        "{size: 5 mm, refine: [{corners: {mm: [[0, -9, -9], [10, 9, 9]]}, size: 0.02 mm}]}",
        "with about 1.1e+09 of them",
    ),
}


@pytest.mark.parametrize("mesh, part", SIZES.values(), ids=SIZES.keys())
def test_a_size_that_makes_too_many_cells_is_refused_before_meshing(tmp_path, mesh, part):
    own = scene(tmp_path, mesh=mesh)
    with pytest.raises(SpecError, match=re.escape(part)), own.locating():
        meshing.make_mesh(own, tmp_path)


def test_a_surface_in_metres_with_a_size_in_millimetres_is_refused(tmp_path):
    box_stl(tmp_path / "box.stl")  # 3 x 1 x 1
    for unit, part in (
        ("1 m", "about 2.0e+08 of them"),
        ("1 mm", "cells of 5 mm are larger than the body, 3 x 1 x 1 mm"),
    ):
        own = scene(tmp_path, geometry=f"{{kind: mesh-file, path: box.stl, unit: {unit}}}")
        with pytest.raises(SpecError, match=re.escape(part)):
            meshing.make_mesh(own, tmp_path)


def boxes_step(path, *corners):
    """Boxes, each by the place of its lowest corner and its size in mm, as solids of their own in one file."""
    code = (
        "import gmsh, sys; gmsh.initialize(interruptible=False); gmsh.option.setNumber('General.Terminal', 0);"
        f"occ = gmsh.model.occ; [occ.addBox(*corner) for corner in {corners!r}];"
        "occ.synchronize(); gmsh.write(sys.argv[1]); gmsh.finalize()"
    )
    subprocess.run([sys.executable, "-c", code, str(path)], check=True, capture_output=True)


@pytest.mark.parametrize("apart", [(50, 0, 0), (30, 10, 0)], ids=["apart", "edge to edge"])
def test_two_bodies_in_one_file_are_told_of_assemblies(tmp_path, apart):
    boxes_step(tmp_path / "two.step", (0, 0, 0, 30, 10, 10), (*apart, 30, 10, 10))
    own = scene(tmp_path, geometry="{kind: step, path: two.step}")
    with pytest.raises(InputError, match=r"two\.step: the geometry is 2 separate bodies, not one .*kind: assembly"):
        meshing.make_mesh(own, tmp_path)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1)])
def test_solids_that_touch_are_one_body_and_each_names_its_cells(tmp_path, order):
    """A bar, a wider plate at its end, and a knob on that: their faces differ, and the mesh has one surface between."""
    boxes = [(0, 0, 0, 30, 10, 10), (30, -5, -5, 5, 20, 20), (35, 0, 0, 5, 5, 5)]
    boxes_step(tmp_path / "three.step", *(boxes[place] for place in order))
    own = scene(tmp_path, geometry="{kind: step, path: three.step}", materials=regions([[0, 0, 0], [15, 10, 10]]))
    mesh, volume = meshing.make_mesh(own, tmp_path)
    assert volume == pytest.approx(3000 + 2000 + 125) and mesh.volumes.sum() == pytest.approx(volume)
    assert pieces(mesh) == 1 and volume_within(mesh, [[0, 0, 0], [15, 10, 10]]) == (pytest.approx(1500),) * 2
    for number, place in enumerate(order, start=1):
        cells, (*low, a, b, c) = mesh.cell_sets[f"solid-{number}"], boxes[place]
        assert mesh.volumes[cells].sum() == pytest.approx(a * b * c)
        corners = mesh.X[mesh.cells[cells]].reshape(-1, 3)
        np.testing.assert_allclose([corners.min(axis=0), np.ptp(corners, axis=0)], [low, (a, b, c)], atol=1e-6)


def test_what_two_solids_both_fill_is_a_solid_of_its_own(tmp_path):
    boxes_step(tmp_path / "two.step", (0, 0, 0, 30, 10, 10), (20, 0, 0, 30, 10, 10))
    mesh, volume = meshing.make_mesh(scene(tmp_path, geometry="{kind: step, path: two.step}"), tmp_path)
    assert volume == pytest.approx(5000) and pieces(mesh) == 1
    found = {name: mesh.volumes[cells].sum() for name, cells in mesh.cell_sets.items()}
    assert found == pytest.approx({"solid-1": 2000, "solid-2": 1000, "solid-3": 2000})


@pytest.mark.usefixtures("anew")
def test_missing_libraries_become_one_sentence_with_the_packages(tmp_path, monkeypatch):
    fake = tmp_path / "gmsh.py"
    fake.write_text("raise OSError('libGLU.so.1: cannot open shared object file')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(InputError, match=r"libGLU\.so\.1.*apt-get install libglu1-mesa"):
        meshing.make_mesh(scene(tmp_path, geometry="{kind: bar}"), tmp_path)


def test_set_up_installs_the_packages_that_the_message_names():
    script = (Path(__file__).parents[3] / "scripts" / "setup.sh").read_text()
    assert set(ask_gmsh.DEBIAN_PACKAGES.split()) == set(script.split('packages="')[1].split('"')[0].split())


@pytest.mark.parametrize("geometry", ["{kind: step, path: none.step}", "{kind: mesh-file, path: none.vtu}"])
def test_missing_files(tmp_path, geometry):
    with pytest.raises(InputError, match="no such file"):
        meshing.make_mesh(scene(tmp_path, geometry=geometry), tmp_path)


BAR_BOX = [[8, -9, 0], [17, 9, 4]]  # through both sides of the bar
FINGER_SLAB = [[-20, -1, -20], [20, 30, -15]]
STEP_BOX = [[5, 2, 3], [25, 8, 7]]  # around part of the slot


@pytest.mark.parametrize(
    "geometry, corners, expected, total",
    [
        ("{kind: bar, length: 30 mm}", BAR_BOX, 9 * 10 * 4, 3000),
        ("{kind: soft-finger}", FINGER_SLAB, 17.5 * 20 * 5, None),
        ("{kind: step, path: slot.step}", STEP_BOX, 20 * 6 * 4 - 10 * 2 * 4, 2800),
    ],
)
def test_no_tetrahedron_straddles_a_box_of_another_material(tmp_path, geometry, corners, expected, total):
    slot_step(tmp_path / "slot.step")
    own = scene(tmp_path, geometry=geometry, materials=regions(corners), mesh="{size: 9 mm, element: tet4}")
    mesh, volume = meshing.make_mesh(own, tmp_path)
    assert volume_within(mesh, corners) == pytest.approx((expected, expected), rel=1e-9)
    assert mesh.volumes.sum() == pytest.approx(total or volume, rel=1e-9 if total else 0.01)
    assert pieces(mesh) == 1 and (mesh.volumes > 0).all()


def test_regions_may_overlap_touch_and_lie_beside_the_body(tmp_path):
    boxes = [[[0, -9, -9], [10, 9, 9]], [[5, -9, -9], [20, 9, 0]], [[40, 0, 0], [50, 5, 5]]]
    mesh, _ = meshing.make_mesh(scene(tmp_path, materials=regions(*boxes)), tmp_path)
    assert [volume_within(mesh, box)[0] for box in boxes] == pytest.approx([1000, 750, 0])
    assert mesh.volumes.sum() == pytest.approx(3000) and pieces(mesh) == 1 and mesh.X[:, 0].max() <= 30


@pytest.mark.parametrize("element", ["tet4", "tet10p0", "hex8"])
def test_the_bar_in_any_element(tmp_path, element):
    own = scene(tmp_path, mesh=f"{{size: 5 mm, element: {element}}}", materials=regions(BAR_BOX))
    mesh, volume = meshing.make_mesh(own, tmp_path)
    assert mesh.volumes.sum() == pytest.approx(volume, rel=1e-12) and volume == pytest.approx(3000)
    assert volume_within(mesh, BAR_BOX) == pytest.approx((360, 360))
    assert (mesh.cells.shape[1], mesh.facets.shape[1]) == {"tet4": (4, 3), "tet10p0": (10, 6), "hex8": (8, 4)}[element]


@pytest.mark.parametrize(
    "geometry, element, part",
    [
        ("{kind: soft-finger}", "hex8", "geometry: kind soft-finger cannot be meshed with hex8 .* works with kind bar"),
        ("{kind: step, path: slot.step}", "hex8", "kind step cannot"),
        ("{kind: mesh-file, path: box.stl}", "hex8", "kind mesh-file cannot .* mesh files of hexahedra"),
        ("{kind: mesh-file, path: tets.vtu}", "hex8", "tets.vtu holds tetrahedra.* tet4, tet10 or tet10p0"),
        ("{kind: mesh-file, path: hexes.vtu}", "tet4", r"hexes.vtu holds hexahedra.*set mesh.element to hex8"),
        ("{kind: assembly, parts: [{name: f, geometry: {kind: soft-finger}}]}", "hex8", "part 'f': kind soft-finger"),
    ],
)
def test_an_element_that_the_geometry_cannot_have_says_which_works(tmp_path, geometry, element, part):
    slot_step(tmp_path / "slot.step")
    box_stl(tmp_path / "box.stl")
    write_mesh(tmp_path / "tets.vtu", block((1, 1, 1), (1, 1, 1)))
    write_mesh(tmp_path / "hexes.vtu", hexahedra((1, 1, 1), (1, 1, 1)))
    with pytest.raises(SpecError, match=part):
        meshing.make_mesh(scene(tmp_path, geometry=geometry, mesh=f"{{size: 5 mm, element: {element}}}"), tmp_path)


def test_hexahedra_of_the_user(tmp_path):
    write_mesh(tmp_path / "own.vtu", hexahedra((3, 2, 1), (3, 2, 1), distort=0.1))
    own = scene(tmp_path, geometry="{kind: mesh-file, path: own.vtu, unit: 1 cm}", mesh="{size: 1 mm, element: hex8}")
    mesh, _ = meshing.make_mesh(own, tmp_path)
    assert mesh.volumes.sum() == pytest.approx(6000) and mesh.cells.shape == (6, 8)


def test_a_named_face_has_the_middles_of_its_edges(tmp_path):
    mesh = block((2, 1, 1), (2, 1, 1))
    flags = {"set:held": (mesh.X[:, 0] == 0).astype(np.int8)}
    meshio.write(tmp_path / "own.vtu", meshio.Mesh(mesh.X, [("tetra", mesh.cells)], point_data=flags))
    geometry = "{kind: mesh-file, path: own.vtu}"
    own = scene(tmp_path, geometry=geometry, mesh="{size: 1 mm}", fixed="[{kind: name, name: held}]")
    mesh, _ = meshing.make_mesh(own, tmp_path)
    np.testing.assert_array_equal(select_nodes(mesh, own.fixed[0], "fixed.0"), np.flatnonzero(mesh.X[:, 0] == 0))


PAIR = (
    "{kind: assembly, parts: [{name: a, geometry: {kind: bar, length: 30 mm}}, "
    "{name: b, geometry: {kind: bar, length: 30 mm}, rotate: {axis: [0, 0, 1], angle: 180 deg}, "
    "translate: {mm: [30, 30, 0]}}]}"
)


@pytest.mark.parametrize("element", ["tet4", "tet10p0", "hex8"])
def test_equal_parts_of_an_assembly_have_equal_meshes_in_their_places(tmp_path, element):
    own = scene(tmp_path, geometry=PAIR, mesh=f"{{size: 5 mm, element: {element}}}")
    mesh, volume = meshing.make_mesh(own, tmp_path)
    a, b = (mesh.X[mesh.node_sets[name]] for name in "ab")
    np.testing.assert_allclose(b, a * [-1, -1, 1] + [30, 30, 0], atol=1e-12)
    assert volume == pytest.approx(6000) and mesh.volumes.sum() == pytest.approx(6000) and pieces(mesh) == 2
    for name in "ab":
        assert set(mesh.cells[mesh.cell_sets[name]].ravel()) == set(mesh.node_sets[name])
        assert set(mesh.facets[mesh.facet_sets[name]].ravel()) <= set(mesh.node_sets[name])
        assert mesh.volumes[mesh.cell_sets[name]].sum() == pytest.approx(3000)


def test_regions_are_in_the_coordinates_of_the_scene_and_refinement_in_those_of_the_part(tmp_path):
    corners = [[-10, 5, -9], [10, 12, 0]]
    fine = "refine: [{corners: {mm: [[0, -5, -5], [6, 5, 5]]}, size: 1.5 mm, blend: 1 mm}]"
    where = "rotate: {axis: [0, 0, 1], angle: 70 deg}"
    geometry = f"{{kind: assembly, parts: [{{name: a, geometry: {{kind: bar, length: 30 mm}}, {where}, {fine}}}]}}"
    mesh, _ = meshing.make_mesh(scene(tmp_path, geometry=geometry, materials=regions(corners)), tmp_path)
    turn = np.radians(70)
    # a strip of the bar between y = 5 and 12, both well inside its length, of half of its height
    expected = 10 / np.sin(turn) * 7 * 5
    assert volume_within(mesh, corners) == pytest.approx((expected, expected), rel=1e-9)
    along = mesh.X @ [np.cos(turn), np.sin(turn), 0]
    assert (along < 6).sum() > 4 * ((along > 20) & (along < 26)).sum()


def test_a_part_of_its_own_size(tmp_path):
    geometry = (
        "{kind: assembly, parts: [{name: a, geometry: {kind: bar}}, {name: b, geometry: {kind: bar}, size: 2 mm}]}"
    )
    mesh, _ = meshing.make_mesh(scene(tmp_path, geometry=geometry, mesh="{size: 5 mm, element: hex8}"), tmp_path)
    assert [len(mesh.cell_sets[name]) for name in "ab"] == [12 * 2 * 2, 30 * 5 * 5]


def test_the_corners_of_a_quadratic_mesh_are_the_linear_one():
    linear = block((3, 2, 1), (3, 2, 1))
    sets = {"end": np.flatnonzero(linear.X[:, 0] == 3)}
    linear = Mesh(linear.X, linear.cells, linear.facets, sets)
    again = meshing.corners_of(meshing.with_middles(linear))
    for field in ("X", "cells", "facets"):
        np.testing.assert_array_equal(getattr(again, field), getattr(linear, field))
    np.testing.assert_array_equal(again.node_sets["end"], sets["end"])
