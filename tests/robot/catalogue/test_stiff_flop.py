"""The pneumatic trunk: its mesh, its compliance at rest against known figures, and its three models against each
other."""

from pathlib import Path

import numpy as np
import pytest

from cfem.constraint.cavity import make_cavity
from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.element import HEX_CORNERS
from cfem.mechanics.rod.region import CrossSection
from cfem.robot.build import build_robot
from cfem.robot.catalogue.cross_sections import stiff_flop_section
from cfem.robot.catalogue.stiff_flop import StiffFlop, chamber_area, chamber_surface
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.mesh.quality import quality
from cfem.robot.spec import SceneSpec

WEIGHT = ["gravity={acceleration: {m/s^2: [0, 0, -9.81]}}"]
SCENE = Path(__file__).parents[3] / "pipelines" / "stiff-flop" / "scene.yaml"
KPA = 1e-3  # MPa
MN = 1e-3  # N


def scene(element, slices, *changes):
    return load_spec(SCENE, SceneSpec, [f"mesh.element={element}", f"mesh.size={55 / slices!r} mm", *changes])


def robot(element, slices, *changes):
    made = scene(element, slices, *changes)
    return build_robot(made, make_mesh(made, SCENE.parent)[0])


@pytest.mark.parametrize("slices", [5, 7, 13, 21])
def test_at_rest_any_number_of_slices_is_in_equilibrium_at_once(slices):
    found = solve(Problem(robot("hex8-full", slices)), force(np.zeros(6)))
    assert found.converged and found.residual <= found.tolerance
    assert found.iterations <= 3


def at_rest(element, slices, *changes):
    return solve(Problem(robot(element, slices, *changes)), force(np.zeros(6))).condensed.W


def test_the_section_has_the_known_area_and_moment():
    shape = stiff_flop_section(StiffFlop(kind="stiff-flop"))
    assert shape.area == pytest.approx(73.9, rel=1e-3)
    assert shape.bending == pytest.approx(682.5, rel=1e-4)
    assert chamber_area(StiffFlop(kind="stiff-flop")) == pytest.approx(1.6875)


def test_the_hexahedra_fill_the_section_and_leave_the_chambers():
    made = scene("hex8-full", 3)
    mesh, volume = make_mesh(made, SCENE.parent)
    figures = quality(mesh, volume)
    assert figures.inverted == 0 and figures.smallest_scaled_jacobian > 0.3
    assert figures.volume_error == pytest.approx(0.0, abs=1e-12)
    shape, X = stiff_flop_section(made.geometry), mesh.X
    robot_ = build_robot(made, mesh)
    part = robot_.body.solids[0]
    N = (1 + part.element.points[:, None] * HEX_CORNERS).prod(axis=2) / 8
    points = N @ X[part.cells]
    assert (part.weights * points[..., 1] ** 2).sum() == pytest.approx(55 * shape.bending, rel=1e-9)
    pair = make_cavity(X, chamber_surface(made.geometry, mesh, 2, [4, 3]), "pair")
    assert pair.rest_volume == pytest.approx(2 * 55 * 1.6875)
    assert X[pair.nodes][:, 0].min() == pytest.approx(55.0) and (X[pair.nodes][:, 1] < 0).any()


def test_ten_slices_of_hexahedra_have_the_reference_compliance():
    """Of the authors' model, measured at rest: mm and kPa."""
    W = at_rest("hex8-full", 10)
    pressures = np.zeros((6, 6))
    for block, (own, other) in {0: (0.1161, 0.0223), 3: (0.1934, 0.0371)}.items():
        pressures[block : block + 3, block : block + 3] = np.where(np.eye(3), own, other)
    np.testing.assert_allclose(W[3:, 3:] * KPA, pressures, atol=1e-3 * 0.1934)
    tip = [
        [0.01586] * 3 + [0.02644] * 3,
        [0, 0.3821, -0.3821, 0, 0.2123, -0.2123],
        [-0.4412, 0.2206, 0.2206, -0.2451, 0.1226, 0.1226],
    ]
    np.testing.assert_allclose(W[:3, 3:] * KPA, tip, atol=1e-3 * 0.2206)
    np.testing.assert_allclose(np.diag(W)[1:3] * MN, 4.025, rtol=1e-3)
    softer = at_rest("hex8-full", 10, "material.young=125 kPa", "materials.0.material.young=70 kPa")
    np.testing.assert_allclose(np.diag(softer)[1:3] * MN, 4.897, rtol=1e-3)


def test_the_rod_has_the_converged_compliance():
    np.testing.assert_allclose(np.diag(at_rest("beam", 20))[1:3] * MN, 4.476, rtol=1e-3)
    softer = at_rest("beam", 20, "material.young=125 kPa", "materials.0.material.young=70 kPa")
    np.testing.assert_allclose(np.diag(softer)[1:3] * MN, 5.447, rtol=1e-3)


def test_hexahedra_with_reduced_integration_are_the_rod_at_rest():
    """Timoshenko elements with one point and elements of constant strain are the same to first order."""
    np.testing.assert_allclose(at_rest("hex8-reduced", 4), at_rest("beam", 4), atol=1e-6)


def test_hexahedra_tend_to_the_rod_in_large_bending():
    pressures = force([0.1, 0.0, 0.02, 0.05, 0.0, 0.0])
    exact = solve(Problem(robot("beam", 4)), pressures)
    assert np.linalg.norm(exact.delta_e) > 50
    errors = []
    for slices in (5, 10):
        solved = solve(Problem(robot("hex8-reduced", slices)), pressures)
        assert solved.converged
        errors.append(np.linalg.norm(solved.delta_e - exact.delta_e))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.15)  # of second order
    np.testing.assert_allclose(errors[1], 0.0, atol=0.05 * np.linalg.norm(exact.delta_e))


def test_a_solid_whose_chambers_are_wound_is_softer_by_what_its_sections_contract():
    """Fibres that contract freely resist with E, not with lambda + 2 mu, 5.6 % more."""
    W, rod = at_rest("hex8", 10), at_rest("beam", 10)
    softer = W[:3, :3].diagonal() / rod[:3, :3].diagonal()
    assert ((softer > 1.02) & (softer < 1.056)).all()
    made = robot("hex8", 2)
    assert sorted({len(group) for group in made.rigid}) == [12, 114] and len(made.rigid) == 2 * (1 + 6)


def test_without_load_the_rod_is_the_same_however_few_its_elements():
    pressures = force([0.1, 0.0, 0.02, 0.05, 0.2, 0.0])
    one, many = (solve(Problem(robot("beam", slices)), pressures) for slices in (1, 12))
    np.testing.assert_allclose(one.delta_e, many.delta_e, atol=1e-9)
    np.testing.assert_allclose(one.delta, many.delta, rtol=1e-9)
    assert one.energy == pytest.approx(many.energy, rel=1e-9)


def test_its_weight_is_that_of_its_material():
    made = robot("beam", 5, "material.density=1070 kg/m^3", "materials.0.material.density=1070 kg/m^3", *WEIGHT)
    np.testing.assert_allclose(made.loads.sum(axis=0), [0, 0, -9810 * 1.07e-9 * 73.875 * 110], rtol=1e-3)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        (["mesh.element=tet4"], "geometry stiff-flop goes with mesh.element"),
        (["geometry={kind: bar}"], "goes with mesh.element"),
        (["actuators.0.module=3"], "no module 3"),
        (["actuators.0.chambers=[1, 1]"], "named twice"),
        (["actuators.0.pressure={kPa: [200, 0]}"], "the smaller first"),
        (["geometry.chamber_circle=2 mm"], "must lie between"),
    ],
)
def test_each_mistake_is_named(changes, part):
    with pytest.raises(SpecError, match=part):
        load_spec(SCENE, SceneSpec, changes)


def test_a_point_beyond_the_tip_is_named():
    with pytest.raises(SpecError, match=r"effector 'tip' at \(111, 0, 0\) mm lies outside the sections"):
        robot("beam", 2, "effectors.0.point={mm: [111, 0, 0]}")


def test_a_section_that_does_not_deform_resists_with_the_constrained_modulus():
    stiff = CrossSection(2.0, 3.0, 6.0).stiffness(150.0, 0.15)
    lam, mu = 150 * 0.15 / (1.15 * 0.7), 150 / 2.3
    np.testing.assert_allclose(stiff, [2 * (lam + 2 * mu), 2 * mu, 2 * mu, 6 * mu, *[3 * (lam + 2 * mu)] * 2])
