"""The bar from its YAML: rows, sizes, and that it pays for nothing that it has not."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from robot.scenes import BASE
from robot.scenes import scene as small_scene
from scipy.spatial.transform import Rotation
from support.blocks import hexahedra

from cfem.core.errors import SpecError
from cfem.core.spec import load_spec
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.mechanics.mesh import Mesh, boundary_facets
from cfem.robot.build import build_robot
from cfem.robot.mesh.mesh_file import write_mesh
from cfem.robot.mesh.meshing import make_mesh
from cfem.robot.spec import SceneSpec

PIPELINES = Path(__file__).parents[2] / "pipelines"
BAR = PIPELINES / "bar" / "scene.yaml"


@pytest.fixture(scope="module")
def bar():
    scene = load_spec(BAR, SceneSpec)
    mesh, _ = make_mesh(scene, BAR.parent)
    return scene, mesh


def test_rows_reach_and_rest(bar):
    robot = build_robot(*bar)
    assert robot.rows.names == ("tip.x", "tip.y", "tip.z", "cable")
    np.testing.assert_array_equal(robot.reach, [[0.0, 8.0]])
    np.testing.assert_allclose(robot.rest_e, [59.0, 0, 0], atol=1e-12)
    assert (robot.body.mesh.X[robot.fixed, 0] == 0).all()


def test_the_finger_is_symmetric_and_its_tip_is_carried(tmp_path):
    path = PIPELINES / "soft-finger" / "scene.yaml"
    scene = load_spec(path, SceneSpec, ["mesh.element=tet4"])
    robot = build_robot(scene, make_mesh(scene, path.parent)[0])
    assert robot.rows.actuators == ("left", "right")
    np.testing.assert_allclose(robot.rest_e, [0, 10, -120], atol=1e-12)
    assert [cable.rest_length for cable in robot.actuators] == pytest.approx([110.6667] * 2)


CABLE = "actuators.0.route=null\nactuators.0.points={{mm: [{}]}}"
IMPOSSIBLE = {
    "point outside": (
        CABLE.format("[15, 0, 4], [35, 40, 4]"),
        "--set: actuators.0.points.1: point 1 of cable 'cable' at (35, 40, 4) mm lies outside",
    ),
    "nothing held": ("fixed.0.point={mm: [-50, 0, 0]}", "fixed.0: the plane selects no node"),
    "points coincide": (
        CABLE.format("[15, 0, 4], [15, 0, 4]"),
        "actuators.0: cable 'cable': point 0 and point 1 coincide",
    ),
    "effector outside": (
        "effectors.0={name: tip, point: {mm: [300, 0, 0]}}",
        "effectors.0: effector 'tip' at (300, 0, 0) mm",
    ),
    "effector held": (
        "effectors.0={name: tip, point: {mm: [0, 0, 0]}, radius: 0 mm}",
        "--set: effectors.0: effector 'tip' lies where `fixed` holds the body",
    ),
    "reach beyond the cable": (
        "actuators.0.reach={mm: [0, 500]}",
        "--set: actuators.0.reach: cable 'cable' is 55 mm long and cannot be shortened by 500 mm",
    ),
}


@pytest.mark.parametrize("override, part", IMPOSSIBLE.values(), ids=IMPOSSIBLE.keys())
def test_what_cannot_be_built_is_named_with_its_place(bar, override, part):
    scene = load_spec(BAR, SceneSpec, override.splitlines())
    with pytest.raises(SpecError, match=re.escape(part)):
        build_robot(scene, bar[1])


def test_a_misplaced_point_is_named_with_file_and_line(bar, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(BAR.read_text().replace("route: {side: z+}", "points: {mm: [[35, 0, 4], [55, 40, 4]]}"))
    line = next(number for number, text in enumerate(path.read_text().splitlines(), 1) if "[55, 40, 4]" in text)
    with pytest.raises(SpecError, match=rf"^{re.escape(str(path))}:{line}: actuators\.0\.points\.\d: point"):
        build_robot(load_spec(path, SceneSpec), bar[1])


def test_the_smallest_scene_pays_for_nothing_that_it_has_not(bar):
    """No contact rows, no design parameters, one cable; and no torch, gmsh, matplotlib or onnx to solve it."""
    robot = build_robot(*bar)
    assert (robot.rows.n, robot.rows.n_c) == (4, 0)
    assert (robot.contacts, robot.rigid, robot.loads, len(robot.body.solids)) == ((), (), None, 1)
    code = (
        "import sys\n"
        "from cfem.equilibrium import solve\nfrom cfem.equilibrium.system import problem\n"
        "from cfem.robot import build, load\nimport cfem.sample.runner\n"
        "print([m for m in ('torch', 'gmsh', 'matplotlib', 'onnx', 'onnxruntime', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


TWO = (
    "{kind: assembly, parts: [{name: a, geometry: {kind: bar, length: 30 mm}}, "
    "{name: b, geometry: {kind: bar, length: 30 mm}, translate: {mm: [0, 10, 0]}}]}"
)
AIR = "[{kind: cavity, name: air, %s, reach: {mm^3: [0, 5]}}]"
GRAVITY = "{acceleration: {m/s^2: [1, 2, -9]}}"


def made(folder, **changes):
    scene = small_scene(folder, **changes)
    return build_robot(scene, make_mesh(scene, folder)[0])


def hollow(path):
    """A cube of 9 mm with a void of 3 mm in its middle, facet sets `wall` of the void and `skin`, in cells of 3 mm."""
    full = hexahedra((9, 9, 9), (3, 3, 3))
    cells = np.delete(full.cells, 13, axis=0)
    facets = boundary_facets(cells)
    inner = np.flatnonzero((abs(full.X[facets] - 4.5).max(axis=2) < 2).all(axis=1))
    outer = np.setdiff1d(np.arange(len(facets)), inner)
    write_mesh(path, Mesh(full.X, cells, facets, facet_sets={"wall": inner, "skin": outer}))
    return f"{{kind: mesh-file, path: {path.name}}}"


def test_the_outer_skin_is_no_wall_of_a_chamber(tmp_path):
    with pytest.raises(SpecError, match="'air': 'skin' is the outer skin of the body"):
        made(
            tmp_path,
            geometry=hollow(tmp_path / "own.vtu"),
            mesh="{size: 3 mm, element: hex8}",
            actuators=AIR % "surface: skin",
            effectors="[{name: tip, point: {mm: [9, 4.5, 4.5]}}]",
        )


@pytest.mark.parametrize("where", ["inside: {mm: [4.5, 4, 5]}", "surface: wall"])
def test_a_cavity_by_a_point_inside_or_by_the_name_of_its_wall(tmp_path, where):
    robot = made(
        tmp_path,
        geometry=hollow(tmp_path / "own.vtu"),
        mesh="{size: 3 mm, element: hex8}",
        actuators=AIR % where,
        effectors="[{name: tip, point: {mm: [9, 4.5, 4.5]}}]",
    )
    (cavity,) = robot.actuators
    assert cavity.rest_volume == pytest.approx(27) and robot.rows.actuators == ("air",)
    assert cavity.value(1.1 * robot.body.mesh.X) == pytest.approx(27 * (1.1**3 - 1))
    assert robot.unilateral.tolist() == [False] and robot.reach.tolist() == [[0, 5]]


def test_a_chamber_of_the_finger(tmp_path):
    robot = made(
        tmp_path,
        geometry="{kind: soft-finger}",
        mesh="{size: 12 mm, refine: [{corners: {mm: [[-15, -1, -45], [15, 15, -35]]}, size: 3 mm}]}",
        fixed="[{kind: plane, point: {mm: [0, 0, -3]}, normal: [0, 0, 1]}]",
        actuators=AIR % "inside: {mm: [5, 6, -40]}",
        effectors="[{name: tip, point: {mm: [0, 10, -120]}}]",
    )
    assert robot.actuators[0].rest_volume == pytest.approx(143.475, rel=0.02)


def test_rows_of_contacts_and_of_orientation_come_in_order(tmp_path):
    robot = made(
        tmp_path,
        contacts="[{name: low, point: {mm: [20, 0, -5]}}, {name: high, point: {mm: [20, 0, 5]}, radius: 3 mm}]",
        effectors="[{name: tip, points: {mm: [[28, 0, 4], [28, 0, -2]]}, orientation: true, radius: 3 mm}]",
    )
    assert robot.rows.contacts == ("low.x", "low.y", "low.z", "high.x", "high.y", "high.z")
    assert robot.rows.effectors == ("tip.x", "tip.y", "tip.z", "tip.rx", "tip.ry", "tip.rz")
    np.testing.assert_allclose(robot.rest_e, [28, 0, 1, 0, 0, 0], atol=1e-9)
    np.testing.assert_allclose([contact.rest for contact in robot.contacts], [[20, 0, -5], [20, 0, 5]], atol=1e-9)


def test_each_region_has_its_material_and_later_ones_win(tmp_path):
    box = "{kind: box, corners: {mm: [[%s, -9, -9], [%s, 9, 9]]}}"
    regions = [
        (box % (5, 20), "law: neo-hookean-log, young: 2 MPa"),
        (box % (15, 30), "law: ogden, mu: {MPa: [3]}, alpha: [2]"),
    ]
    lines = ", ".join(f"{{region: {where}, material: {{{what}, poisson: 0.25}}}}" for where, what in regions)
    robot = made(tmp_path, materials=f"[{lines}]")
    volumes = {part.law.name: part.weights.sum() for part in robot.body.solids}
    assert volumes == pytest.approx({"neo-hookean": 500, "neo-hookean-log": 1000, "ogden": 1500})


def test_gravity_weighs_each_material_and_loads_add_to_it(tmp_path):
    half = "{kind: box, corners: {mm: [[20, -9, -9], [30, 9, 9]]}}"
    material = "young: 1 MPa, poisson: 0.3, density: "
    robot = made(
        tmp_path,
        material=f"{{{material} 1000 kg/m^3}}",
        materials=f"[{{region: {half}, material: {{{material} 3 g/cm^3}}}}]",
        gravity=GRAVITY,
        loads="[{point: {mm: [25, 1, 2]}, force: {mN: [0, 0, 500]}, radius: 4 mm}]",
    )
    mass = np.array([2000 * 1e-9, 1000 * 3e-9])  # t
    weights = mass[:, None] * np.array([1e3, 2e3, -9e3])
    np.testing.assert_allclose(robot.loads.sum(axis=0), weights.sum(axis=0) + [0, 0, 0.5], rtol=1e-9)
    moment = sum(np.cross(arm, force) for arm, force in zip([[10, 0, 0], [25, 0, 0]], weights, strict=True))
    moment = moment + np.cross([25, 1, 2], [0, 0, 0.5])
    np.testing.assert_allclose(np.cross(robot.body.mesh.X, robot.loads).sum(axis=0), moment, rtol=1e-9)


def test_what_names_a_body_is_attached_to_no_other(tmp_path):
    at = "point: {mm: [20, 5, 0]}, body: b"  # on the face that the two share in space
    robot = made(
        tmp_path,
        geometry=TWO,
        actuators="[{kind: cable, name: c, points: {mm: [[5, 5, 0], [25, 5, 0]]}, reach: {mm: [0, 3]}, body: b}]",
        contacts=f"[{{name: touch, {at}}}]",
        effectors=f"[{{name: tip, orientation: true, {at}}}]",
        loads=f"[{{force: {{N: [0, 0, 1]}}, {at}}}]",
        rigid="[{kind: plane, point: {mm: [30, 0, 0]}, normal: [1, 0, 0]}]",
    )
    own = robot.body.mesh.node_sets["b"]
    for each in (*robot.actuators, *robot.contacts, *robot.effectors):
        assert np.isin(each.nodes, own).all()
    assert not robot.loads[robot.body.mesh.node_sets["a"]].any() and robot.loads[own].any()
    (rigid,) = robot.rigid
    assert 0 < np.isin(rigid, own).sum() < len(rigid)  # a group may join two bodies


@pytest.mark.parametrize(
    "changes, part",
    [
        (
            {"actuators": BASE["actuators"].replace("reach", "body: c, reach")},
            "actuators.0.body: the mesh has no cell set 'c'",
        ),
        ({"contacts": "[{name: k, point: {mm: [20, 0, 0]}, body: c}]"}, "it has a, b"),
        (
            {"contacts": "[{name: k, point: {mm: [20, 12, 0]}, body: a}]"},
            "contact point 'k' at (20, 12, 0) mm lies outside",
        ),
        (
            {"loads": "[{point: {mm: [20, 0, 9]}, force: {N: [0, 0, 1]}}]"},
            "loads.0: load at (20, 0, 9) mm lies outside",
        ),
        ({"actuators": AIR % "inside: {mm: [15, 0, 0]}"}, "cavity 'air'"),
        (
            {"actuators": AIR % "surface: wall"},
            "actuators.0.surface: the mesh has no facet set 'wall' (it has a, b)",
        ),
        (
            {"materials": "[{region: {kind: name, name: c}, material: {young: 1 MPa, poisson: 0}}]"},
            "materials.0.region",
        ),
        ({"rigid": "[{kind: name, name: a}]"}, "rigid.0: shares 12 of its 96 nodes with fixed"),
    ],
)
def test_what_cannot_be_attached_is_named(tmp_path, changes, part):
    with pytest.raises(SpecError, match=re.escape(part)):
        made(tmp_path, geometry=TWO, **changes)


def test_two_bodies_joined_by_a_rigid_group_move_together(tmp_path):
    """A second bar that only a rigid connector holds: the cable in the first bar carries its end along."""
    part = "geometry: {kind: bar, length: 30 mm, width: 10 mm, height: 10 mm}"
    left, right = f"{{name: left, {part}}}", f"{{name: right, {part}, translate: {{mm: [32, 0, 0]}}}}"
    scene = small_scene(
        tmp_path,
        geometry=f"{{kind: assembly, parts: [{left}, {right}]}}",
        mesh="{size: 6 mm, element: tet10p0}",
        rigid="[{kind: box, corners: {mm: [[29.9, -9, -9], [32.1, 9, 9]]}}]",
        actuators="[{kind: cable, name: c, body: left, pull_point: {mm: [0, 0, 4]}, "
        "points: {mm: [[10, 0, 4], [28, 0, 4]]}, reach: {mm: [0, 3]}}]",
        effectors="[{name: near, point: {mm: [28, 0, 0]}}, {name: far, body: right, point: {mm: [60, 0, 0]}}]",
    )
    robot = build_robot(scene, make_mesh(scene, tmp_path)[0])
    found = solve(Problem(robot), displacement([1.5]))
    assert found.converged, found.status.value
    near, far = found.delta_e[:3], found.delta_e[3:]
    # the second bar is neither held nor loaded: it follows the connector as a rigid body
    connector = robot.rigid[0]
    X, x = robot.body.mesh.X[connector], found.state.x[connector]
    turn, _ = Rotation.align_vectors(x - x.mean(axis=0), X - X.mean(axis=0))
    carried = x.mean(axis=0) + turn.apply([60.0, 0, 0] - X.mean(axis=0)) - [60.0, 0, 0]
    np.testing.assert_allclose(far, carried, atol=1e-7)
    assert far[2] > 1.5 * near[2] > 0.1
