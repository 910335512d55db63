"""A round body of cones: as a rod, as tetrahedra, and against the engineer's formulas."""

import numpy as np
import pytest
from robot.scenes import scene
from scipy.optimize import minimize

from cfem.core.errors import SpecError
from cfem.equilibrium.solve import Wanted, solve
from cfem.equilibrium.system.actuation import force
from cfem.equilibrium.system.problem import Problem
from cfem.robot.build import build_robot
from cfem.robot.catalogue.taper import volume
from cfem.robot.mesh.meshing import make_mesh

TAPER = {
    "length": "100 mm",
    "geometry": "{kind: taper, places: {mm: [0, 60, 100]}, radii: {mm: [10, 6, 4]}}",
    "mesh": "{size: 5 mm, element: beam}",
    "material": "{young: 400 kPa, poisson: 0.48, density: 1000 kg/m^3}",
    "actuators": "[{kind: cable, name: c, points: {mm: [[0, 0, 5], [90, 0, 2]]}, reach: {mm: [0, 30]}}]",
    "effectors": "[{name: tip, point: {mm: [100, 0, 0]}, orientation: true}]",
}


def problem(folder, **changes):
    found = scene(folder, **(TAPER | changes))
    mesh, _ = make_mesh(found, folder)
    return Problem(build_robot(found, mesh))


def tip(problem, lam):
    found = solve(problem, force(np.array([lam])), wanted=Wanted(condense=False))
    assert found.converged
    return found.delta_e[:3]


def test_rod_weighs_what_its_cones_hold(tmp_path):
    made = problem(tmp_path, gravity="{acceleration: {m/s^2: [10, 0, 0]}}")
    cones = volume(scene(tmp_path, **TAPER).geometry)
    exact = np.pi / 3 * (60 * (100 + 60 + 36) + 40 * (36 + 24 + 16))
    assert cones == pytest.approx(exact) and made.loads[:, 0].sum() == pytest.approx(exact * 1e-9 * 1e4, rel=1e-9)


def test_small_bend_of_a_cone_is_that_of_the_beam_formula(tmp_path):
    push = "[{kind: push, name: c, points: {mm: [[100, 0, 0]]}, direction: [0, 0, 2], reach: {mm: [-5, 5]}}]"
    made = problem(tmp_path, actuators=push, mesh="{size: 1 mm, element: beam}")
    moved = tip(made, 1e-4)
    x = np.linspace(0, 100, 200001)
    radius = np.interp(x, [0, 60, 100], [10, 6, 4])
    G, k = 0.4 / 2 / 1.48, 6 * 1.48 / (7 + 6 * 0.48)
    slope = (100 - x) ** 2 / (0.4 * np.pi / 4 * radius**4) + 1 / (k * G * np.pi * radius**2)
    assert moved[2] == pytest.approx(1e-4 * np.trapezoid(slope, x), rel=2e-4)


def test_tetrahedra_hold_what_the_cones_hold(tmp_path):
    """All along, though their facets are flat: coarse cells leave a circle six sides."""
    for size, near in (("7 mm", 0.02), ("3.5 mm", 0.01)):
        found = scene(tmp_path, **(TAPER | {"mesh": f"{{size: {size}, element: tet4}}"}))
        mesh, cad = make_mesh(found, tmp_path)
        assert mesh.volumes.min() > 0 and mesh.volumes.sum() == pytest.approx(cad, rel=1e-3)
        middles = mesh.X[mesh.cells].mean(axis=1)[:, 0]
        for low, high in ((0, 50), (50, 100)):
            x = np.linspace(low, high, 5001)
            wanted = np.trapezoid(np.pi * np.interp(x, [0, 60, 100], [10, 6, 4]) ** 2, x)
            inside = (middles >= low) & (middles < high)
            assert mesh.volumes[inside].sum() == pytest.approx(wanted, rel=near)


def test_rod_and_tetrahedra_agree(tmp_path):
    rod = tip(problem(tmp_path), 1.0)
    points = ", ".join(f"[{x}, 0, {5 - x / 30:.4f}]" for x in range(0, 95, 5))
    cable = f"[{{kind: cable, name: c, points: {{mm: [{points}]}}, reach: {{mm: [0, 30]}}, through_air: true}}]"
    solid = tip(problem(tmp_path, mesh="{size: 5 mm}", actuators=cable), 1.0)
    assert np.linalg.norm(rod) > 15
    assert np.linalg.norm(solid - rod) < 0.03 * np.linalg.norm(rod)


@pytest.mark.parametrize("tension", [1.0, 6.0])
def test_an_eccentric_cable_bends_a_straight_rod_to_the_arc_of_least_energy(tmp_path, tension):
    """Energy of the fibres, summed over the disc, and tension times length, both on an arc of constant strain."""
    made = problem(
        tmp_path,
        geometry="{kind: taper, places: {mm: [0, 100]}, radii: {mm: [8, 8]}}",
        actuators="[{kind: cable, name: c, points: {mm: [[0, 0, 5], [100, 0, 5]]}, reach: {mm: [0, 30]}}]",
    )
    found = solve(made, force(np.array([tension])), wanted=Wanted(condense=False))
    r, phi = (np.arange(100) + 0.5) / 100 * 8, (np.arange(60) + 0.5) / 60 * 2 * np.pi
    z, ring = np.outer(r, np.sin(phi)), 2 * np.pi * r * 8 / 100

    def energy(u):
        lam = 1 + u[0] + u[1] / 8 * z
        return (ring * (0.4 / 6 * (lam**2 + 2 / lam - 3)).mean(axis=1)).sum() + tension * (1 + u[0] + u[1] / 8 * 5)

    least = minimize(energy, [-0.01, -0.05], method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-12})
    assert found.converged
    # turn of the tip about -y
    assert found.delta_e[4] == pytest.approx(100 * least.x[1] / 8, rel=2e-4)
    arc = 100 * (1 + least.x[0])
    assert (found.delta_e + made.robot.rest_e)[0] == pytest.approx(
        arc * np.sin(found.delta_e[4]) / found.delta_e[4], rel=2e-4
    )


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ("{kind: taper, places: {mm: [0, 50]}, radii: {mm: [5]}}", "as many places as radii"),
        ("{kind: taper, places: {mm: [5, 50]}, radii: {mm: [5, 4]}}", "begin at 0"),
        ("{kind: taper, places: {mm: [0, 50]}, radii: {mm: [5, 0]}}", "above 0"),
    ],
)
def test_impossible_cones_are_told(tmp_path, geometry, message):
    with pytest.raises(SpecError, match=message):
        scene(tmp_path, **(TAPER | {"geometry": geometry}))


def test_cable_of_a_rod_ascends_within_it(tmp_path):
    for points, message in (("[[0, 0, 5], [120, 0, 2]]", "outside the sections"), ("[[9, 0, 5], [0, 0, 2]]", "ascend")):
        cable = f"[{{kind: cable, name: c, points: {{mm: {points}}}, reach: {{mm: [0, 3]}}}}]"
        with pytest.raises(SpecError, match=message):
            problem(tmp_path, actuators=cable)
