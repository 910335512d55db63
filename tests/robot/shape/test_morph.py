"""A mesh that follows the design: on its surfaces, smoothly, with the volume of the CAD model."""

import numpy as np
import pytest
from scipy.spatial import Delaunay, cKDTree

from cfem.constraint.attachment import attach
from cfem.core.errors import NumericalError, SpecError
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.cad import Box, Difference, Frustum, Placed, Prism
from cfem.robot.catalogue.soft_finger import SoftFinger, route, soft_finger
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.shape.morph import Morph, _Anderson
from cfem.robot.shape.surfaces import PlaneSurface, surfaces
from cfem.robot.spec import SceneSpec

SCENE = {
    "name": "finger",
    "out": "out",
    "length": "120 mm",
    "geometry": {
        "kind": "soft-finger",
        "slope": "30 deg",
        "plateau": "3 mm",
        "wall": "3 mm",
        "centre_wall": "0 mm",
        "cork": "3 mm",
    },
    "mesh": {"size": "9 mm", "element": "tet10p0"},
    "material": {"law": "neo-hookean", "young": "3000 kPa", "poisson": 0.45},
    "fixed": [{"kind": "plane", "point": {"mm": [0, 0, -3]}, "normal": [0, 0, 1]}],
    "actuators": [{"kind": "cable", "name": "c", "route": {"x": "0 mm", "y": "17.75 mm"}, "reach": {"mm": [0, 20]}}],
    "effectors": [{"name": "tip", "at": "tip"}],
}


def finger(L=40.0, H=21.0, JH=6.5):
    values = {"segment_length": L, "height": H, "joint_height": JH}
    shape = SoftFinger.model_validate({**SCENE["geometry"], **{key: f"{value} mm" for key, value in values.items()}})
    return shape


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    scene = SceneSpec.model_validate(SCENE).model_copy(update={"geometry": finger()})
    mesh, volume = make_mesh(scene, tmp_path_factory.mktemp("m"))
    points = [attach(mesh, point, 2.0, "p") for point in route(finger(), 0.0, 17.75)]
    return mesh, volume, Morph(mesh, soft_finger(finger()), points)


def places(shape):
    return route(shape, 0.0, 17.75)


def test_the_reference_is_left_alone(reference):
    mesh, _, morph = reference
    np.testing.assert_allclose(morph(soft_finger(finger()), places(finger())).X, mesh.X, atol=1e-9)


# volumes by the CAD kernel, mm^3
@pytest.mark.parametrize(
    "design, volume", [((40, 20, 6), 37896.4), ((38, 20, 5), 35262.0), ((42, 22, 8), 44094.1), ((40, 21, 6), 39281.9)]
)
def test_a_design_has_its_volume_and_its_points(reference, design, volume):
    mesh, exact, morph = reference
    made = morph(soft_finger(finger(*design)), places(finger(*design)))
    # flat facets lose about as much of the round bellows in every design
    lost = exact - mesh.volumes.sum()
    assert made.volumes.sum() == pytest.approx(volume - lost, rel=4e-4)
    reached = [point.position(made.X) for point in morph._points]
    np.testing.assert_allclose(reached, places(finger(*design)), atol=1e-9)
    on = made.X[np.unique(made.facets[:, :3])]
    assert on[:, 2].min() == pytest.approx(-3 * design[0], abs=1e-9)
    assert np.array_equal(made.cells, mesh.cells)


def test_nodes_move_smoothly(reference):
    """Second differences over steps of 0.01 mm are those of a smooth curve, three designs of the family apart."""
    _, _, morph = reference
    X = [morph(soft_finger(finger(41 + h, 20.5, 7)), places(finger(41 + h, 20.5, 7))).X for h in (-0.01, 0, 0.01)]
    slope, bend = (X[2] - X[0]) / 0.02, (X[2] - 2 * X[1] + X[0]) / 0.01**2
    assert 0.5 < np.abs(slope).max() < 20 and np.abs(bend).max() < 1.0


def test_changes_are_the_derivatives_of_the_nodes(reference, monkeypatch):
    """Against differences of fourth order of whole morphs, of a length, a height and a joint's at once. Where surfaces
    meet at small angles, what is missing from them moves a node by a thousand times as much: morphs are closer here."""
    monkeypatch.setattr("cfem.robot.shape.morph._TOLERANCE", 3e-13)
    _, _, morph = reference
    here = np.array([41.0, 20.5, 7.0])

    def design(values):
        shape = finger(*values)
        return soft_finger(shape), places(shape)

    X, sums, expected = morph(*design(here)).X, [], []
    for axis in np.eye(3):
        sums.append([(k / 0.008, *design(here + k * 0.004 * axis)) for k in (-1, 1)])
        ends = [morph(*design(here + k * 0.02 * axis)).X for k in (2, 1, -1, -2)]
        expected.append((8 * (ends[1] - ends[2]) - (ends[0] - ends[3])) / 0.24)
    found = morph.changes(design(here)[0], X, sums)
    np.testing.assert_allclose(found, expected, atol=5e-7 * np.abs(expected).max())


def test_a_design_too_far_is_refused(reference):
    with pytest.raises(NumericalError, match="of its volume left"):
        reference[2](soft_finger(finger(60, 40, 20)), places(finger(60, 40, 20)))


def test_a_block_follows_its_walls_affinely():
    X = np.array([[i, j, k] for i in (0.0, 1.0) for j in (0.0, 1.0) for k in (0.0, 1.0)] + [[0.4, 0.5, 0.6]])
    cells = Delaunay(X).simplices
    edges = X[cells[:, 1:]] - X[cells[:, :1]]
    cells[np.linalg.det(edges) < 0] = cells[np.linalg.det(edges) < 0][:, [0, 2, 1, 3]]
    mesh = Mesh(X, cells, boundary_facets(cells))
    morph = Morph(mesh, Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))
    grown = morph(Box((0.0, 0.0, 0.0), (2.0, 1.0, 0.5)), np.zeros((0, 3)))
    assert grown.volumes.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(np.ptp(grown.X, axis=0), [2.0, 1.0, 0.5], atol=1e-9)
    with pytest.raises(SpecError, match="do not lie on a surface"):
        Morph(mesh, Box((0.0, 0.0, 0.0), (1.0, 1.0, 3.0)))


@pytest.mark.parametrize(
    "solid",
    [
        Box((0.0, -1.0, 2.0), (1.0, 4.0, 3.0)),
        Prism(((0.0, 0.0), (2.0, 0.0), (1.0, 3.0)), -1.0, 2.0),
        Frustum((1.0, 2.0, 3.0), (0.0, 0.0, 5.0), 2.0, 1.0),
        Difference(Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), (Frustum((0.5, 0.5, 0), (0.0, 0.0, 1.0), 0.2, 0.2),)),
    ],
)
def test_gradients_are_those_of_the_values_and_of_length_one(solid):
    rng = np.random.default_rng(0)
    x, h = rng.normal(size=(5, 3)) * 2, 1e-6
    for surface in surfaces(solid):
        numeric = np.stack([(surface.value(x + d) - surface.value(x - d)) / (2 * h) for d in h * np.eye(3)], axis=1)
        np.testing.assert_allclose(surface.gradient(x), numeric, atol=1e-8)
        np.testing.assert_allclose(np.linalg.norm(numeric, axis=1), 1.0, atol=1e-8)


def test_surfaces_pass_through_the_corners_they_should():
    low, high = surfaces(Box((0.0, -1.0, 2.0), (1.0, 4.0, 3.0)))[:2]
    assert isinstance(low, PlaneSurface)
    assert low.value(np.array([[0.0, 9, 9]]))[0] == 0 == high.value(np.array([[1.0, 0, 0]]))[0]
    with pytest.raises(ValueError, match="not known"):
        surfaces(Placed(Box((0, 0, 0), (1, 1, 1)), (0, 0, 1), 1.0, (0, 0, 0)))


def test_a_mirrored_mesh_is_its_own_image_and_so_is_its_morph(tmp_path):
    scene = SceneSpec.model_validate(SCENE).model_copy(update={"geometry": finger()})
    scene = scene.model_copy(update={"mesh": scene.mesh.model_copy(update={"mirror": "x"})})
    mesh, volume = make_mesh(scene, tmp_path)
    assert volume == pytest.approx(39561.35, abs=0.01) and mesh.volumes.min() > 0
    design = finger(41, 20.5, 7.5)
    for X in (mesh.X, Morph(mesh, soft_finger(finger()))(soft_finger(design), np.zeros((0, 3))).X):
        seen = X * [-1, 1, 1]
        assert cKDTree(X).query(seen)[0].max() < 1e-9


def test_steps_that_shrink_what_is_missing_by_a_tenth_are_combined_to_few():
    shrink, x, past = np.diag([0.1, 0.05, 1.0, 0.3]), np.zeros(4), _Anderson()
    for _ in range(8):  # the plain steps need 440
        missing = np.ones(4) - shrink @ x
        x = x + past.accelerated(missing, missing)
    np.testing.assert_allclose(shrink @ x, 1, atol=1e-10)
