"""Robots of other shapes from one mesh: their equilibria, and how these follow the design."""

import numpy as np
import pytest
from support.bar_scene import bar_scene

from cfem.core.errors import NumericalError, SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.system.actuation import displacement
from cfem.robot.build import build_robot
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec
from cfem.sample.family import RobotFamily
from cfem.sample.parameters import scene_parameters
from cfem.sample.solver import FiniteElements
from cfem.sample.spec import ParameterSpec

PARAMETERS = {
    "height": ParameterSpec(key="geometry.height", range=["9 mm", "12 mm"]),
    "length": ParameterSpec(key="geometry.length", range=["59 mm", "62 mm"]),
    "nu": ParameterSpec(key="material.poisson", range=[0.4, 0.48]),
}
PULL = displacement(np.array([1.5]))


@pytest.fixture(scope="module")
def solver(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    (folder / "scene.yaml").write_text(bar_scene(8, "tet10p0", 0.45))
    parameters = scene_parameters(PARAMETERS, folder / "scene.yaml")
    scene = load_spec(folder / "scene.yaml", SceneSpec)
    mesh, _ = make_mesh(scene, folder)
    return RobotFamily(scene, mesh, parameters), scene, mesh, folder, parameters


def finite_elements(case):
    _, scene, mesh, _, parameters = case
    return FiniteElements(scene, mesh, 1e-11, parameters)()


def test_a_design_that_ends_before_its_effector_is_named_with_the_point(solver):
    said = r"design length 50 mm for 60 mm, near effector 'tip' at \(58, 0, 0\) mm: the m"
    with pytest.raises(NumericalError, match=said):
        solver[0].at(np.array([10.0, 50.0, 0.45]))


def test_a_design_is_the_robot_built_on_its_mesh(solver):
    """All that is attached stays on its nodes, so that it is that robot but for how points are attached."""
    family, scene, _, _, _ = solver
    design = family.at(np.array([11.0, 61.0, 0.45]))
    assert design.body.mesh.volumes.sum() == pytest.approx(61 * 11 * 10, rel=1e-9)
    built = build_robot(scene, design.body.mesh)
    assert design.actuators[0].rest == pytest.approx(built.actuators[0].rest)
    np.testing.assert_allclose(design.rest_e, built.rest_e, atol=1e-9)
    assert family.alike


def test_slopes_by_design_parameters_are_those_of_solved_robots(solver):
    solve = finite_elements(solver).solve
    p = np.array([10.5, 60.5, 0.44])
    here = solve(PULL, None, p)
    assert here.converged
    for index, (h, coordinate) in enumerate([(1e-3, 1.0), (1e-3, 1.0), (1e-4, -2 / (1 - 2 * 0.44))]):
        step = h * np.eye(3)[index]
        ahead, behind = (solve(PULL, here.state, p + sign * step) for sign in (1, -1))
        slope = (ahead.energy - behind.energy) / (2 * h) / coordinate
        assert here.slopes.psi[index] == pytest.approx(slope, rel=1e-5, abs=1e-6 * here.energy)
        force = (ahead.lambda_a - behind.lambda_a) / (2 * h) / coordinate
        np.testing.assert_allclose(here.slopes.lam[:, index], force, rtol=1e-4)
        moved = (ahead.state.x - behind.state.x) / (2 * h) / coordinate
        np.testing.assert_allclose(here.slopes.x[:, :, index], moved, atol=1e-5 * np.abs(moved).max())


def test_states_do_not_depend_on_the_design_that_they_are_started_from(solver):
    solve = finite_elements(solver).solve
    other = solve(PULL, None, np.array([9.2, 61.8, 0.41]))
    fresh, started = (solve(PULL, start, np.array([11.5, 59.5, 0.47])) for start in (None, other.state))
    np.testing.assert_allclose(started.condensed.W, fresh.condensed.W, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(started.delta_e, fresh.delta_e, atol=1e-8)


def test_what_does_not_move_with_a_design_is_refused(solver):
    _, scene, mesh, _, parameters = solver
    loaded = scene.model_copy(update={"loads": [object()]})
    with pytest.raises(SpecError, match="loads cannot follow"):
        RobotFamily(loaded, mesh, parameters)
