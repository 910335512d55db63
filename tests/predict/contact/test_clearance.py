"""Distances of a learned robot's body to obstacles, against finite elements that the model never saw."""

import numpy as np
import pytest
from support.closed import octahedral_sphere

import cfem
from cfem.contact.clearance import nearest_of_surface
from cfem.contact.obstacle import Box, Capsule, ClosedMesh, Plane, Sphere
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.predict.contact.clearance import clearance, row_gradient

DIRECTIONS, TRIANGLES = octahedral_sphere(2)
AT = np.array([1.0, 9.0, 4.0])  # mm from the bar's end: out of its own way
OBSTACLES = {
    "plane": Plane(t=np.array([0.0, 0.0, -25.0])),
    "sphere": Sphere(5.0, t=AT),
    "box": Box(np.array([4.0, 3.0, 6.0]), t=AT),
    "capsule": Capsule(3.0, 8.0, t=AT),
    "mesh": ClosedMesh(ClosedSurface(5 * DIRECTIONS, TRIANGLES), t=AT),
}


@pytest.fixture(scope="module")
def obstacles(model):
    """About the bar's free end."""
    end = model.skin.rest[np.argmax(np.linalg.norm(model.skin.modes[0], axis=1))]
    return {name: type(one)(**{**vars(one), "t": one.t + end}) for name, one in OBSTACLES.items()}


def test_it_is_the_distance_of_the_fe_surface_to_the_error_of_the_shape(bar, model, obstacles):
    robot = cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml", bar / "data" / "bar" / "mesh")
    for delta in ([1.3], [4.1]):
        true = cfem.solve(robot, displacement=delta).state.x[model.skin.nodes]
        error = np.linalg.norm(model.shape(delta) - true, axis=1).max()
        assert 0 < error < 1e-3 * model.length
        for obstacle in obstacles.values():
            expected = nearest_of_surface(true, model.facets, obstacle, 1e-4)
            found = clearance(model, delta, obstacle, tolerance=1e-4)
            assert abs(found.distance - expected.distance) <= error + 1e-4


@pytest.mark.parametrize("form", ["displacement", "force"])
def test_its_gradient_is_that_of_finite_differences(bar, model, obstacles, form, tmp_path):
    if form == "force":
        spec = bar / "pipelines" / "bar" / "train.yaml"
        cfem.run_stage("train", spec, out=tmp_path / "force", overrides=["model={kind: spectral, form: force}"])
        model = cfem.load_model(tmp_path / "force")
    h, delta = 1e-4, np.array([2.5])
    rows = model.skin.rows
    ahead, behind = (rows(*model.learned_inputs(delta + side * h, None)) for side in (1, -1))
    slope = (ahead - behind) / (2 * h)
    np.testing.assert_allclose(row_gradient(model, delta)[:, 0], slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max())
    for name in ("plane", "sphere", "capsule"):  # whose distance is smooth along the way
        found = clearance(model, delta, obstacles[name], tolerance=1e-7)
        sides = [clearance(model, delta + side * h, obstacles[name], tolerance=1e-7).distance for side in (1, -1)]
        assert found.gradient[0] == pytest.approx((sides[0] - sides[1]) / (2 * h), rel=0.02, abs=5e-3)
