"""Layers of a scene: which faces they lie on, in the body too, and what is refused."""

import numpy as np
import pytest
from robot.scenes import scene
from support.blocks import box

from cfem.core.errors import SpecError
from cfem.mechanics.mesh import Mesh
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh

PAPER = "thickness: 0.1 mm, young: 5 GPa, poisson: 0.2"
BELOW = "faces: {kind: plane, point: {mm: [0, 0, -5]}, normal: [0, 0, -1]}"
INSIDE = "faces: {kind: box, corners: {mm: [[0, -5, 1], [30, 5, 1]]}}"


def layers(tmp_path, text, element="tet10", **changes):
    """Layers of the bar of 30 x 10 x 10 mm, in cubes of 2.5 mm cut into tetrahedra unless a mesh is made."""
    own = scene(tmp_path, layers=text, mesh=f"{{size: 5 mm, element: {element}}}", **changes)
    plain = box((30, 10, 10), (12, 4, 4), element)
    mesh = Mesh(plain.X - [0, 5, 5], plain.cells, plain.facets, facet_sets={"skin": np.arange(4)})
    return mesh, build_robot(own, mesh).body.layers


@pytest.mark.parametrize("element", ["tet4", "tet10", "tet10p0"])
def test_layers_lie_on_the_surface_or_on_a_sheet_in_the_body(tmp_path, element):
    sheet = INSIDE.replace("1]", "2.5]")
    mesh, (below, inside, skin) = layers(
        tmp_path,
        f"[{{{BELOW}, {PAPER}}}, {{{sheet}, {PAPER}}}, {{faces: {{kind: name, name: skin}}, {PAPER}}}]",
        element,
    )
    for layer, z in ((below, -5.0), (inside, 2.5)):
        assert np.unique(mesh.X[layer.facets][..., 2]) == pytest.approx([z])
        assert layer.weights.sum() == pytest.approx(0.1 * 300)  # each face once
        np.testing.assert_array_equal(mesh.cells[layer.owner[:, None], layer.nodes], layer.facets)
    a, b, c = mesh.X[inside.facets[:, :3]].swapaxes(0, 1)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()  # along z, about which fibres turn
    np.testing.assert_array_equal(skin.facets, mesh.facets[:4])
    assert below.fabric.young == 5000.0 and below.moduli[0, 0, 0] == pytest.approx(5000 / (1 - 0.04))


def test_a_mesh_that_is_made_has_faces_on_the_sheet(tmp_path):
    own = scene(tmp_path, layers=f"[{{{INSIDE}, {PAPER}}}]", mesh="{size: 6 mm, element: tet4}")
    mesh, volume = make_mesh(own, tmp_path)
    (layer,) = build_robot(own, mesh).body.layers
    assert layer.weights.sum() == pytest.approx(0.1 * 300) and mesh.volumes.sum() == pytest.approx(volume)


def test_fibres_turn_about_the_outward_normal(tmp_path):
    """Seen from outside, below, x is turned towards -y by a positive angle."""
    fibres = "fibres: [{direction: [1, 0, 0], angle: 30 deg, young: 1 GPa}]"
    _, (layer,) = layers(tmp_path, f"[{{{BELOW}, thickness: 0.2 mm, {fibres}}}]")
    c, s = np.cos(np.pi / 6), -np.sin(np.pi / 6)
    m = np.array([c * c, s * s, c * s])
    stretched = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])  # E_xx or E_yy alone, by the faces' own axes
    for axis in range(2):
        t = layer.frames[:, :, axis]
        strain = np.stack([t[:, 0] ** 2, t[:, 1] ** 2, 2 * t[:, 0] * t[:, 1]], axis=1)
        energy = np.einsum("ki,kij,kj->k", strain, layer.moduli, strain)
        np.testing.assert_allclose(energy, 1000 * (m @ stretched[:, axis]) ** 2, rtol=1e-12)


@pytest.mark.parametrize(
    "text, changes, said",
    [
        (f"[{{{BELOW}, thickness: 0.1 mm}}]", {}, "layers.0: a layer needs young or fibres"),
        (f"[{{{BELOW.replace('-5]', '-6]')}, {PAPER}}}]", {}, "the plane selects no face"),
        (f"[{{faces: {{kind: name, name: no}}, {PAPER}}}]", {}, "no facet set 'no'"),
        (
            f"[{{{BELOW}, thickness: 0.1 mm, fibres: [{{direction: [0, 0, 1], young: 1 GPa}}]}}]",
            {},
            "fibres is normal to 96 faces",
        ),
        (f"[{{{BELOW}, {PAPER}}}]", {"element": "hex8"}, "layers: lie on faces of tetrahedra"),
    ],
)
def test_what_cannot_be_is_one_sentence(tmp_path, text, changes, said):
    with pytest.raises(SpecError, match=said):
        layers(tmp_path, text, **changes)
