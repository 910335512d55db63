"""Modules in a row from the model of one, against finite elements of the whole trunk."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation
from support.fast_cases import fast_are

from cfem.condensed.rotation import cross_matrix, left_jacobian
from cfem.constraint.patch import PatchLoad
from cfem.contact.obstacle import Sphere
from cfem.contact.surface.closed_surface import ClosedSurface
from cfem.core.errors import InputError, NumericalError
from cfem.core.stage import Options
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.problem import Problem
from cfem.export.compiled.build import compiler
from cfem.export.compiled.shape import CompiledShape
from cfem.export.firmware.folder import write_c
from cfem.export.firmware.skin import write_c_row_skin
from cfem.export.spec import CSpec
from cfem.export.stage import run as export
from cfem.plant.fem_plant import pushed
from cfem.predict.contact.clearance import clearance
from cfem.predict.load import build, load_model
from cfem.predict.loads.loaded import loaded
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.robot.stage import run as make_mesh
from cfem.sample.stage import run as sample
from cfem.surrogate import stage
from cfem.surrogate.stage import run as train

PIPELINES = Path(__file__).parents[3] / "pipelines"
QUIET = Options(quiet=True)
WHOLE, MODULE = "stiff-flop", "stiff-flop-module"


needs_compiler = pytest.mark.skipif(compiler() is None, reason="there is no C compiler on the PATH")
CENTRE = "  - {name: body, at: centre-of-mass}\n"


def heavy(path):
    """The scene with densities, and its centre of mass as the last effector."""
    text = path.read_text().rstrip() + "\n" + CENTRE
    path.write_text(text.replace("poisson: 0.15}", "poisson: 0.15, density: 1070 kg/m^3}"))


def coarser(path, size="19 mm", **rows):
    text = path.read_text().replace("2.75 mm", size)
    for split, (before, after) in rows.items():
        text = text.replace(f"{split}: {{rows: {before}", f"{split}: {{rows: {after}")
    path.write_text(text)


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """Both robots on coarse meshes: nothing here is about how fine they are."""
    root = tmp_path_factory.mktemp("project")
    for name in (WHOLE, MODULE):
        shutil.copytree(PIPELINES / name, root / "pipelines" / name)
        coarser(root / "pipelines" / name / "scene.yaml")
        heavy(root / "pipelines" / name / "scene.yaml")
    coarser(root / "pipelines" / WHOLE / "sample.yaml", train=(200, 10), test=(100, 8))
    coarser(root / "pipelines" / MODULE / "sample.yaml", train=(50, 50), test=(50, 5))
    for name in (MODULE, WHOLE):
        folder = root / "pipelines" / name
        make_mesh(folder / "scene.yaml", [], None, QUIET)
        sample(folder / "sample.yaml", [], None, QUIET, workers=1)
    monkeypatch = pytest.MonkeyPatch()
    monkeypatch.setattr(stage, "QUERIES", 500)
    train(root / "pipelines" / MODULE / "train.yaml", [], None, QUIET)
    train(root / "pipelines" / WHOLE / "train-serial.yaml", [], None, QUIET)
    yield root
    monkeypatch.undo()


class FiniteElementModule:
    """What the row asks of a module's model, answered by finite elements."""

    def __init__(self, problem: Problem):
        self._problem = problem
        self.rows, self.rest_e = problem.robot.rows, problem.robot.rest_e

    def evaluate(self, delta):
        found = [solve(self._problem, displacement(one), slack=False).condensed for one in delta.reshape(-1, 3)]
        W, free = np.array([one.W for one in found]), np.array([one.delta_free for one in found])
        n = self.rows.n
        return W.reshape(*delta.shape[:-1], n, n), free.reshape(*delta.shape[:-1], n)


def problem_of(project, name):
    return Problem(build_robot(*load_scene_and_mesh(project / "pipelines" / name / "scene.yaml")))


def test_two_modules_in_a_row_are_the_whole_trunk(project):
    model = load_model(project / "models" / WHOLE / "serial")
    model.models = [FiniteElementModule(problem_of(project, MODULE))]
    problem = problem_of(project, WHOLE)
    for pressures in 0.2 * np.random.default_rng(0).random((3, 6)):
        solved = solve(problem, force(pressures))
        found = model.at(solved.delta)
        np.testing.assert_allclose(found.lam, pressures, atol=1e-9)
        np.testing.assert_allclose(found.delta_e, solved.delta_e, atol=1e-7)
        size = np.sqrt(np.diag(solved.condensed.W))
        scale = np.outer(size, size)
        np.testing.assert_allclose(found.W / scale, solved.condensed.W / scale, atol=1e-8)


WEIGHT = 9810.0 * np.array([0.0, 0.6, -0.8])  # mm/s^2: towards where no chamber pulls


@pytest.mark.parametrize(("gravity", "least"), fast_are([(0.1, 2.0)], [(0.0, 0.3), (0.1, 2.0)]))
def test_two_modules_under_loads_are_the_whole_trunk(project, gravity, least):
    """2 mN at the tip, which move it by about a millimetre, and a tenth of its weight with them. The row of modules
    knows them from unloaded samples of one module."""
    model = load_model(project / "models" / WHOLE / "serial")
    problem = problem_of(project, WHOLE)
    (mass,) = problem.robot.masses.values()
    rng = np.random.default_rng(3)
    for pressures in 0.2 * rng.random((2, 6)):
        direction = rng.normal(size=3)
        push = 2e-3 * direction / np.linalg.norm(direction)
        wrench = np.concatenate([push, gravity * mass * WEIGHT])
        at = solve(problem, force(pressures)).delta_a
        solved = solve(Problem(pushed(problem.robot, wrench)), displacement(at), slack=False)
        found = loaded(model, wrench).at(at)
        moved = np.linalg.norm((found.delta_e - model.at(at).delta_e)[:3])
        assert moved > least
        off = np.linalg.norm((found.delta_e - solved.delta_e)[:3])
        assert off < (5e-3 * moved if gravity else 1e-3)  # mm; 0.005 to 0.02 of 2 mN without D
        tolerance = 1e-3 if gravity else 1e-6
        np.testing.assert_allclose(found.lam, solved.lambda_a, atol=tolerance * np.abs(solved.lambda_a).max())
        size = np.sqrt(np.diag(solved.condensed.W))
        scale = np.outer(size, size)
        np.testing.assert_allclose(found.W / scale, solved.condensed.W / scale, atol=0.02 if gravity else 2e-3)
        assert found.rows == model.rows


def nodes_in(robot, rest):
    """Numbers in the mesh of the robot of points (m, 3) at rest."""
    distance, nodes = cKDTree(robot.X).query(rest)
    assert distance.max() < 1e-9
    return nodes


def test_its_surface_is_that_of_the_whole_trunk(project):
    """Of one piece, without the faces between the modules; the skin of one module is off by a hundredth of a mm."""
    model, problem = load_model(project / "models" / WHOLE / "serial"), problem_of(project, WHOLE)
    nodes = nodes_in(problem.robot, model.surface.rest)
    assert set(nodes) == set(np.unique(problem.robot.facets))
    said = json.loads((project / "models" / WHOLE / "serial" / "manifest.json").read_text())["results"]
    deltas = []
    for pressures in 0.2 * np.random.default_rng(0).random((3, 6)):
        solved = solve(problem, force(pressures))
        deltas.append(solved.delta_a)
        apart = np.linalg.norm(model.shape(solved.delta_a) - solved.state.x[nodes], axis=1)
        assert apart.max() < 0.001 * model.length
        ClosedSurface(model.shape(solved.delta_a), model.facets)
    np.testing.assert_allclose(model.shape(deltas)[2], model.shape(deltas[2]), atol=1e-12)
    np.testing.assert_allclose(model.shape(np.zeros(6)), model.surface.rest, atol=0.02)
    assert said["skin"]["nodes"] == len(nodes) and said["skin"]["largest_mm"] < 0.001 * model.length
    assert any(
        line.startswith(f"skin: the largest error of {len(nodes)} surface nodes is ") for line in said["headline"]
    )
    with pytest.raises(InputError, match="no rows of a skin of the whole"):
        model.whole(deltas[0])


def test_its_surface_under_a_force_at_the_tip_is_that_of_the_whole_trunk(project):
    model, problem = load_model(project / "models" / WHOLE / "serial"), problem_of(project, WHOLE)
    nodes, push = nodes_in(problem.robot, model.surface.rest), np.array([0.5e-3, 1.5e-3, -1e-3, 0, 0, -3e-3])
    at = solve(problem, force(np.full(6, 0.1))).delta_a
    solved = solve(Problem(pushed(problem.robot, push)), displacement(at), slack=False)
    under = loaded(model, push).shape(at)
    moved = np.linalg.norm(under - model.shape(at), axis=1).max()
    off = np.linalg.norm(under - solved.state.x[nodes], axis=1).max()
    assert moved > 0.5 and off < 0.05 * moved


@pytest.mark.parametrize("share", fast_are({0.8}, [0.3, 0.8]))
def test_a_force_on_a_patch_of_either_module_is_what_the_whole_trunk_feels(project, share):
    """1 mN on the flank, of the lower and of the upper module, whose frame turns with the lower one's end."""
    model = load_model(project / "models" / WHOLE / "serial")
    problem = problem_of(project, WHOLE)
    at = solve(problem, force(0.2 * np.random.default_rng(3).random(6))).delta_a
    rest = model.surface.rest
    height = rest[:, 2].min() + share * np.ptp(rest[:, 2])
    place = rest[np.argmin(np.abs(rest[:, 2] - height) - 0.1 * rest[:, 0])]
    load = PatchLoad(place, 8.0, 1e-3 * np.array([0.3, 1.0, -0.5]))
    free = problem.robot.rows.n_e
    solved = solve(Problem(pushed(problem.robot, np.zeros(free), [load])), displacement(at), slack=False)
    found = loaded(model, patches=[load])
    here = found.at(at)
    moved = np.linalg.norm((solved.delta_e - model.at(at).delta_e)[:3])
    off = np.linalg.norm((here.delta_e - solved.delta_e)[:3])
    assert moved > 0.5 and off < 0.005 * moved and off < found.meta["wrench_error"]
    change = np.abs(solved.lambda_a - model.at(at).lam).max()
    assert np.abs(here.lam - solved.lambda_a).max() < 1e-4 * change


@pytest.mark.parametrize(
    "push", [None, pytest.param(np.array([0.0, 1e-3, 0.0, 0.0, 0.0, -2e-3]), marks=pytest.mark.slow)]
)
def test_the_gradients_of_its_surface_and_clearance_are_those_of_differences(project, push):
    model = load_model(project / "models" / WHOLE / "serial")
    model = model if push is None else loaded(model, push)
    at, h = np.array([10.0, 4.0, 7.0, 3.0, 12.0, 6.0]), 1e-3
    nodes = np.arange(0, len(model.surface.rest), 5)
    gradient = model.surface_gradient(at, nodes)
    obstacle = Sphere(10.0, t=model.shape(at)[-1] + [15.0, 10.0, 5.0])
    slope = clearance(model, at, obstacle, tolerance=1e-8).gradient
    for number, step in enumerate(h * np.eye(6)):
        difference = (model.shape(at + step)[nodes] - model.shape(at - step)[nodes]) / (2 * h)
        np.testing.assert_allclose(gradient[:, :, number], difference, atol=1e-6)
        sides = [clearance(model, at + side * step, obstacle, tolerance=1e-8).distance for side in (1, -1)]
        assert slope[number] == pytest.approx((sides[0] - sides[1]) / (2 * h), abs=1e-4)


def test_the_estimated_error_bounds_that_of_loads(project):
    """To a factor of 1.5. It counts what the model of a module is off, which is more here than what is left out."""
    model, problem = load_model(project / "models" / WHOLE / "serial"), problem_of(project, WHOLE)
    push, ratios = np.array([0, 2e-3, 0, 0, 0, 0]), []
    carrying = loaded(model, push)
    for pressures in 0.2 * np.random.default_rng(3).random((2, 6)):
        free = solve(problem, force(pressures))
        truth = solve(Problem(pushed(problem.robot, push)), displacement(free.delta_a), slack=False)
        moved = carrying.at(free.delta_a).delta_e - model.at(free.delta_a).delta_e
        off = np.linalg.norm((moved - truth.delta_e + free.delta_e)[:3])
        ratios.append(off / carrying.error_at(free.delta_a))
    assert 0.01 < max(ratios) < 1.5, ratios
    assert carrying.meta["wrench_error"] < 0.012
    with pytest.raises((InputError, NumericalError), match=r"take (at most|smaller)"):
        loaded(model, np.array([0, 0.06, 0, 0, 0, 0]))


def five_in_a_row(project, folder):
    """FE robot and model of five modules of one stiffness, whose whole nobody has sampled."""
    scene = yaml.safe_load((project / "pipelines" / WHOLE / "scene.yaml").read_text())
    pairs = [(f"m{i}-{j}", i, pair) for i in range(1, 6) for j, pair in enumerate(([1, 2], [4, 3], [5, 0]))]
    common = {"kind": "chambers", "reach": {"mm^3": [0, 50]}, "pressure": {"kPa": [0, 100]}}
    scene |= {"name": "five", "length": "275 mm", "geometry": {"kind": "stiff-flop", "modules": 5}, "out": "mesh"}
    scene["actuators"] = [{**common, "name": name, "module": i, "chambers": pair} for name, i, pair in pairs]
    scene["effectors"][0]["point"] = {"mm": [275, 0, 0]}
    del scene["materials"]
    (folder / "scene.yaml").write_text(yaml.safe_dump(scene))
    make_mesh(folder / "scene.yaml", [], None, QUIET)
    robot = build_robot(*load_scene_and_mesh(folder / "scene.yaml"))
    two = load_model(project / "models" / WHOLE / "serial")
    meta = {**two.meta, "row": [{"model": 0, "softer": 1.0}] * 5, "length": 275.0, "reach": robot.reach.tolist()}
    meta["rows"] = {"effectors": two.rows.effectors, "actuators": tuple(name for name, *_ in pairs)}
    meta["row_units"] = [*two.meta["row_units"][:6], *two.meta["row_units"][6:9] * 5]
    return Problem(robot), meta | {"rest_e": robot.rest_e.tolist()}, two.arrays


def test_the_estimated_error_of_five_modules_holds_at_19_of_20_states(project, tmp_path):
    """Long lever arms press on what actuators hold: a twisted module softens as the moments across it grow."""
    problem, meta, arrays = five_in_a_row(project, tmp_path)
    rng, (mass,), ratios = np.random.default_rng(5), problem.robot.masses.values(), []
    while len(ratios) < 20:
        directions = rng.normal(size=(2, 3))
        push, weight = (
            directions / np.linalg.norm(directions, axis=1)[:, None] * 10 ** rng.uniform(-1.5, 0, size=(2, 1))
        )
        wrench = np.concatenate([2e-3 * push, 0.1 * 9810 * mass * weight])
        at = solve(problem, force(0.1 * rng.random(15))).delta_a
        truth = solve(Problem(pushed(problem.robot, wrench)), displacement(at), slack=False)
        if not truth.converged or truth.lambda_a.min() < 0:  # a chamber would have to be sucked at
            continue
        carrying = build({**meta, "wrench": wrench.tolist()}, arrays)
        off = np.linalg.norm((carrying.at(at).delta_e - truth.delta_e)[:3])
        ratios.append(off / carrying.error_at(at))
    assert np.sum(np.array(ratios) > 1.0) <= 1 and np.median(ratios) > 0.25, ratios


def test_it_is_judged_by_the_states_of_the_whole(project):
    folder = project / "models" / WHOLE / "serial"
    manifest = json.loads((folder / "manifest.json").read_text())["results"]
    assert manifest["errors"]["states"] == 8 and manifest["samples"] == 50
    assert manifest["errors"]["loss"] < 1e-9
    assert manifest["positive_definite"]["share"] > 0.99


def test_the_torch_module_is_the_same_function(project):
    torch = pytest.importorskip("torch")
    from cfem.predict.load import read_arrays, read_meta
    from cfem.surrogate.modules import module_of

    folder = project / "models" / WHOLE / "serial"
    model, module = load_model(folder), module_of(read_meta(folder), read_arrays(folder))
    delta = np.concatenate([np.zeros((1, 6)), 20 * np.random.default_rng(1).random((5, 6))])
    W, free = module(torch.as_tensor(delta))
    expected_W, expected_free = model.evaluate(delta)
    np.testing.assert_allclose(W.detach(), expected_W, atol=1e-12 * np.abs(expected_W).max())
    np.testing.assert_allclose(free.detach(), expected_free, atol=1e-10)


def test_a_model_of_something_else_is_refused(project):
    spec = project / "pipelines" / WHOLE / "train-serial.yaml"
    with pytest.raises(InputError, match="one end with its orientation"):
        train(spec, ["model.modules=[{model: ../../models/stiff-flop/serial}]"], project / "other", QUIET)
    with pytest.raises(InputError, match="3 modules of 3 and 3 and 3 actuators do not make a robot of 6"):
        train(
            spec,
            [f"model.modules={[{'model': '../../models/stiff-flop-module/spectral'}] * 3}"],
            project / "other",
            QUIET,
        )


def test_the_left_jacobian_takes_rotation_vectors_to_spins():
    rng = np.random.default_rng(2)
    phi = np.concatenate([np.zeros((1, 3)), 1e-3 * rng.standard_normal((2, 3)), rng.standard_normal((3, 3))])
    d, h = rng.standard_normal((6, 3)), 1e-6
    J = left_jacobian(phi)
    ahead, behind = (Rotation.from_rotvec(phi + sign * h * d) for sign in (1, -1))
    spin = (ahead * behind.inv()).as_rotvec() / (2 * h)
    np.testing.assert_allclose((J @ d[:, :, None])[:, :, 0], spin, atol=1e-8)
    turned = Rotation.from_rotvec(phi).as_matrix()
    np.testing.assert_allclose(np.eye(3) + cross_matrix(phi) @ J, turned, atol=1e-13)


@pytest.mark.slow
def test_an_exported_row_has_its_shape_in_python(project, tmp_path):
    trained = project / "models" / WHOLE / "serial"
    spec = tmp_path / "export.yaml"
    spec.write_text(f"model: {trained}\nout: {tmp_path / 'out'}\nformats: [arrays]\n")
    export(spec, [], None, QUIET)
    at = np.array([10.0, 4.0, 7.0, 3.0, 12.0, 6.0])
    np.testing.assert_array_equal(load_model(tmp_path / "out").shape(at), load_model(trained).shape(at))
    with pytest.raises(InputError, match="modules in a row have no shape in format onnx"):
        export(spec, ["shape=true", "formats=[onnx]"], tmp_path / "other", QUIET)


@needs_compiler
def test_its_surface_in_c_is_that_of_python(project, tmp_path):
    whole, out = load_model(project / "models" / WHOLE / "serial"), tmp_path / "c"
    rows = {**whole.meta["rows"], "effectors": whole.rows.effectors[:3]}
    units = whole.meta["row_units"][:3] + whole.meta["row_units"][6:]
    model = build({**whole.meta, "rows": rows, "row_units": units, "rest_e": whole.meta["rest_e"][:3]}, whole.arrays)
    model.skin_source = whole.skin_source
    write_c(out, model.meta, model.arrays, CSpec(), model.domain.states[:2, :6])
    write_c_row_skin(out, model, CSpec())
    strict, at = ("-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic"), 20 * np.ones(6)
    shape = CompiledShape(out, strict)
    for delta in (np.zeros(6), at * [1, 0.2, 0, 0.7, 0.1, 0.4]):
        np.testing.assert_allclose(shape(delta), model.shape(delta), atol=1e-9)
    subprocess.run(["make", "-s", "libcfem.a"], cwd=out, check=True, capture_output=True)


@needs_compiler
@pytest.mark.slow
def test_an_exported_row_under_its_weight_is_in_c_that_of_python(project, tmp_path):
    """And under a force on its flank; what is read again carries all of them."""
    spec, folder = tmp_path / "export.yaml", project / "models" / WHOLE / "serial"
    trained = load_model(folder)
    rest = trained.surface.rest
    place = rest[np.argmin(np.abs(rest[:, 2] - 0.3 * np.ptp(rest[:, 2])) - 0.1 * rest[:, 0])].tolist()
    push = f"{{at: {{mm: {place}}}, radius: 8 mm, force: {{mN: [0.3, 1, -0.5]}}}}"
    loads = f"{{tip: {{force: {{mN: [0, 1, -1]}}}}, body: {{gravity: {{m/s^2: [0, 0, -0.98]}}}}, push: {push}}}"
    spec.write_text(f"model: {folder}\nout: out\nformats: [arrays, c]\nloads: {loads}\nc: {{vectors: 5}}\n")
    results = export(spec, [], None, QUIET)["results"]
    assert results["parity"]["c"] < 1e-12 and results["parity"]["arrays"] == 0.0
    again = load_model(tmp_path / "out")
    mine = loaded(trained, again.wrench, [PatchLoad(place, 8.0, 1e-3 * np.array([0.3, 1.0, -0.5]))])
    assert np.array_equal(again.evaluate(20 * np.ones(6))[0], mine.evaluate(20 * np.ones(6))[0])
    assert np.abs(mine.at(np.zeros(6)).delta_e - loaded(trained, again.wrench).at(np.zeros(6)).delta_e).max() > 0.1
    assert results["c"]["operations"]["model"] > 100_000
    with pytest.raises(InputError, match="have a shape in Python alone"):
        export(spec, ["shape=true"], tmp_path / "other", QUIET)
