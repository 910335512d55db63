"""The bar from scene to dataset: finite elements, worker processes, manifest, and when nothing is done."""

import shutil
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from support.one_thread import solving_beside

from cfem.condensed.skin import read_skin
from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import GateError, OutputError, SpecError
from cfem.core.stage import Options
from cfem.dataset.inspect import describe
from cfem.dataset.reader import read_dataset
from cfem.dataset.schema import SKIN
from cfem.equilibrium.newton import NewtonSettings
from cfem.equilibrium.solve import solve
from cfem.equilibrium.system.actuation import displacement
from cfem.equilibrium.system.problem import Problem
from cfem.robot import stage as mesh_stage
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh
from cfem.sample import runner
from cfem.sample.parameters import with_values
from cfem.sample.solver import FiniteElements
from cfem.sample.stage import COARSE, run

PIPELINE = Path(__file__).parents[2] / "pipelines" / "bar"
QUIET = Options(quiet=True)
SMALL = ["splits.train.rows=6", "splits.test.rows=3", "skeleton=4", "shard=3"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """pipelines/bar with its mesh, in a place of its own."""
    root = tmp_path_factory.mktemp("bar")
    pipeline = shutil.copytree(PIPELINE, root / "pipelines" / "bar")
    mesh_stage.run(pipeline / "scene.yaml", [], None, QUIET)
    with solving_beside():
        run(pipeline / "sample.yaml", SMALL, None, QUIET, workers=2)
    return root


def finite_elements(folder):
    pipeline, mesh = folder / "pipelines" / "bar" / "scene.yaml", folder / "data" / "bar" / "mesh"
    return Problem(build_robot(*load_scene_and_mesh(pipeline, mesh)))


@pytest.fixture
def spec(folder):
    return folder / "pipelines" / "bar" / "sample.yaml"


@pytest.fixture
def samples(folder):
    return folder / "data" / "bar" / "samples"


def test_the_folder_holds_the_splits_and_nothing_of_the_work(samples):
    names = sorted(path.name for path in samples.iterdir())
    assert names == ["manifest.json", "skin.npz", "test.parquet", "train.parquet"]
    assert [path.name for path in samples.parent.iterdir() if "partial" in path.name] == []
    results = read_manifest(samples)["results"]
    assert results["rows"] == {"train": 6, "test": 3} and results["failed"] == 0
    assert 1 <= results["factorizations_per_sample"] < 6 and results["residual_max"] < 1e-8
    assert "dataset of bar: 9 states" in describe(samples)


def test_the_states_obey_the_condensed_identities(samples):
    train = read_dataset(artefact_file(samples, "train.parquet"))
    a, delta = train.rows.a, np.hstack([train.delta_e, train.delta_a])
    np.testing.assert_allclose(
        np.einsum("mij,mj->mi", train.W[:, :, a], train.lambda_a) + train.delta_free, delta, atol=1e-9
    )
    assert np.linalg.eigvalsh(train.W).min() > 0
    order = np.argsort(train.delta_a[:, 0])
    work = np.diff(train.energy[order])
    lam, shortening = train.lambda_a[order, 0], np.diff(train.delta_a[order, 0])
    assert (lam[:-1] * shortening < work).all() and (work < lam[1:] * shortening).all()


def test_the_plan_is_a_pull_by_shares_of_the_reach(samples):
    test = read_dataset(artefact_file(samples, "test.parquet"))
    np.testing.assert_allclose(test.delta_a, test.u * test.meta["reach"][0][1], rtol=1e-8)


def test_unchanged_inputs_run_nothing_and_a_comment_is_no_change(spec):
    scene = spec.parent / "scene.yaml"
    scene.write_text(scene.read_text() + "\n# a comment\n")
    assert run(spec, SMALL, None, QUIET)["status"] == "up to date"
    with pytest.raises(GateError):
        run(spec, [*SMALL, "tolerance=1e-9"], None, Options(check=True))


@pytest.mark.parametrize("change", ["splits.train.seed=7", "splits.train.rows=5", "space=displacement"])
def test_other_inputs_do_not_overwrite_what_was_dear(spec, samples, change):
    before = read_manifest(samples)
    with pytest.raises(OutputError, match="other inputs"):
        run(spec, [*SMALL, "splits.test.rows=4", change], None, QUIET)
    assert read_manifest(samples) == before


def test_more_rows_of_a_sequence_are_added_to_those_that_are_there(spec, samples, tmp_path):
    """The states are those of one run, to the tolerance of the solver. The modes of the skin stay those that are."""
    more, out = [*SMALL, "splits.train.rows=9", "splits.test.rows=4"], tmp_path / "samples"
    shutil.copytree(samples, out)
    assert run(spec, more, out, QUIET, workers=1)["results"]["kept"] == 9
    assert [path.name for path in tmp_path.glob("samples*")] == ["samples"]  # nothing was moved aside
    assert (out / SKIN).read_bytes() == (samples / SKIN).read_bytes()
    at_once = tmp_path / "at-once"
    run(spec, more, at_once, QUIET, workers=1)
    for split, kept in {"train": 6, "test": 3}.items():
        before, now, whole = (read_dataset(place / f"{split}.parquet") for place in (samples, out, at_once))
        assert before.id.tolist() == list(range(kept)) and now.id.tolist() == whole.id.tolist()
        np.testing.assert_array_equal(now.u, whole.u)
        for name in ("delta_a", "delta_e", "lambda_a", "energy", "W", "delta_free"):
            np.testing.assert_array_equal(getattr(now, name)[:kept], getattr(before, name))
            expected = getattr(whole, name)
            np.testing.assert_allclose(getattr(now, name), expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())
        np.testing.assert_array_equal(now.with_skin.W[:kept], before.with_skin.W)
    assert run(spec, more, out, QUIET, workers=1)["status"] == "up to date"


def test_the_full_run_keeps_the_states_of_a_quick_one_and_is_not_called_coarse(spec, samples, tmp_path):
    coarse = tmp_path / "full-quick"
    few = run(spec, SMALL, coarse, QUIET, workers=1, quick=True)
    assert [finding["what"] for finding in few["results"]["judgement"]] == [COARSE]
    assert few["content"] == read_manifest(samples)["content"]
    full = run(spec, [*SMALL, "splits.train.rows=7"], tmp_path / "full", QUIET, workers=1)
    assert full["results"]["kept"] == 9 and "judgement" not in full["results"]
    assert read_manifest(coarse)["content"] == few["content"]


def test_the_rows_of_a_grid_are_others_when_there_are_more(spec, tmp_path):
    grid = [*SMALL, "splits.train.method=grid", "splits.train.rows=3", "skin=null"]
    run(spec, grid, tmp_path, QUIET, workers=1)
    with pytest.raises(OutputError, match="other inputs"):
        run(spec, [*grid, "splits.train.rows=5"], tmp_path, QUIET, workers=1)


@pytest.mark.slow
def test_states_of_robots_that_differ_in_a_modulus_and_in_a_radius(spec, tmp_path):
    """Energies of all rows are one smooth function of (delta_a, p): its slopes by p against whole solves."""
    overrides = [*SMALL, "splits.train.rows=3", "splits.test.rows=1", "skeleton=2", "third_order=true"]
    text = spec.read_text()
    spec.write_text(
        text + "parameters:\n"
        "  nu: {key: material.poisson, range: [0.40, 0.49]}\n"
        "  guide: {key: actuators.0.radius, range: {mm: [1.5, 2.5]}}\n"
        "  E: {key: material.young, range: [1000 kPa, 10000 kPa]}\n"
    )
    try:
        run(spec, overrides, tmp_path / "samples", QUIET, workers=1)
        spelled = spec.read_text().replace("[1000 kPa, 10000 kPa]", "{MPa: [1, 10]}")
        spec.write_text(spelled)
        assert run(spec, overrides, tmp_path / "samples", QUIET)["status"] == "up to date"
    finally:
        spec.write_text(text)
    train = read_dataset(artefact_file(tmp_path / "samples", "train.parquet"))
    assert [one.name for one in train.parameters] == ["nu", "guide"]
    assert [one["name"] for one in train.meta["parameters"] if one["exact"]] == ["E"]
    assert train.u.shape == (3, 3) and train.dW.shape == (3, 1, 4, 4)
    scene, mesh = load_scene_and_mesh(spec.parent / "scene.yaml")
    keys, i, steps = ["material.poisson", "actuators.0.radius"], 1, np.diag([1e-3, 5e-3])
    state = train.p[i], displacement(train.delta_a[i])
    assert solved(scene, mesh, keys, *state).energy == pytest.approx(train.energy[i], rel=1e-9)
    np.testing.assert_allclose(solved(scene, mesh, keys, *state).condensed.W, train.W[i], atol=1e-8)
    for index, step in enumerate(steps):
        ahead, behind = (solved(scene, mesh, keys, train.p[i] + sign * step, state[1]) for sign in (1, -1))
        slope = (ahead.energy - behind.energy) / (2 * step[index])
        assert train.dpsi_dp[i, index] == pytest.approx(slope, rel=2e-3)
        slope = (ahead.lambda_a - behind.lambda_a) / (2 * step[index])
        np.testing.assert_allclose(train.dlambda_dp[i, :, index], slope, rtol=2e-3)
        slope = (ahead.delta_e - behind.delta_e) / (2 * step[index])
        np.testing.assert_allclose(train.ddelta_e_dp[i, :, index], slope, atol=2e-3 * np.abs(slope).max())


def solved(scene, mesh, keys, p, asked):
    """By a robot built from nothing."""
    return solve(
        Problem(build_robot(with_values(scene, keys, p), mesh)), asked, settings=NewtonSettings(tolerance=1e-11)
    )


def test_one_worker_gives_the_same_content_as_two(spec, samples, tmp_path):
    alone = run(spec, SMALL, tmp_path / "samples", QUIET, workers=1)
    assert alone["content"] == read_manifest(samples)["content"]


@pytest.fixture(scope="module")
def skin(folder):
    return read_skin(artefact_file(folder / "data" / "bar" / "samples", "skin.npz"))


def test_rows_of_the_skin_give_the_surface_of_a_state_and_how_it_moves(folder, samples, skin):
    """Against finite elements, solved again here at a delta_a that is the dataset's, and at two beside it."""
    test = read_dataset(artefact_file(samples, "test.parquet"))
    whole, solver, nodes = test.with_skin, finite_elements(folder), skin.nodes
    assert whole.rows.skin == skin.names and whole.W.shape == (3, whole.rows.n, whole.rows.n)

    def surface(delta_a):
        solved = solve(solver, displacement(delta_a), settings=NewtonSettings(tolerance=1e-11))
        return solved.state.x[nodes] - skin.rest, solved.lambda_a

    moved, _ = surface(test.delta_a[0])
    shape = skin.displacements(whole.delta_s[0])
    apart = np.linalg.norm(shape - moved, axis=1)
    assert apart.max() == pytest.approx(whole.left[0, 1], rel=1e-4) and apart.max() < 0.02
    h = 1e-3
    (ahead, lam_ahead), (behind, lam_behind) = surface(test.delta_a[0] + h), surface(test.delta_a[0] - h)
    slope = skin.rows(ahead - behind) / (lam_ahead - lam_behind)
    np.testing.assert_allclose(
        whole.W[0][whole.rows.s, whole.rows.a][:, 0], slope, rtol=1e-5, atol=1e-6 * abs(slope).max()
    )
    assert np.linalg.eigvalsh(whole.W[0]).min() > 0


def test_the_skin_changes_no_other_number_and_costs_no_factorisation_but_in_the_skeleton(folder, samples, spec):
    plain = folder / "plain"
    run(spec, [*SMALL, "skin=null"], plain, QUIET, workers=1)
    for split in ("train.parquet", "test.parquet"):
        mine, other = (read_dataset(artefact_file(one, split)) for one in (samples, plain))
        assert other.with_skin is None and mine.rows == other.rows and mine.meta.keys() == other.meta.keys()
        np.testing.assert_allclose(mine.W, other.W, rtol=1e-7, atol=1e-9 * abs(other.W).max())
        np.testing.assert_allclose(mine.delta_e, other.delta_e, atol=1e-7)
    extra = {
        split: read_dataset(artefact_file(samples, split)).cost["factorizations"]
        - read_dataset(artefact_file(plain, split)).cost["factorizations"]
        for split in ("train.parquet", "test.parquet")
    }
    counts = np.concatenate(list(extra.values()))
    assert sorted(counts) == [0] * 5 + [1] * 4  # the four of the skeleton are condensed twice
    assert not (plain / "skin.npz").exists()


def test_progress_counts_both_solves_of_a_skeleton_with_a_skin(folder, spec, processes, monkeypatch):
    ends, notes = {}, []

    @contextmanager
    def counted(text, total, done=0, poll=None, estimate=True, note=None):
        yield
        ends[text] = (done + poll(), total)
        notes.append(note())

    monkeypatch.setattr(runner, "progress", counted)
    run(spec, SMALL, folder / "counted", QUIET, workers=1)
    assert list(ends.values()) == [(2 * 4, 2 * 4), (5, 5)]
    skeleton, states = (int(note.split(" factorisation")[0]) for note in notes)  # none goes on any more
    files = (artefact_file(folder / "counted", f"{split}.parquet") for split in ("train", "test"))
    spent = sum(read_dataset(file).cost["factorizations"].sum() for file in files)
    assert 8 * skeleton + 5 * states == pytest.approx(spent, abs=8 / 2 + 5 / 2)  # means are rounded


def test_a_tolerance_that_is_not_reached_says_how_far_it_came(folder, spec):
    lines = run(spec, [*SMALL, "skin.tolerance=1 nm", "skin.largest=2"], folder / "two", QUIET, workers=1)["results"]
    assert lines["skin"]["modes"] == 2 and lines["skin"]["largest_mm"] > 1e-3
    assert "the tolerance of 1 nm is NOT reached: allow more modes" in lines["headline"][1]


def test_loads_are_recorded_where_asked_for(folder, spec):
    out = folder / "data" / "loads"
    run(spec, [*SMALL, "loads=true"], out, QUIET, workers=1)
    train = read_dataset(artefact_file(out, "train.parquet"))
    assert train.dW is None and train.dC.shape == (6, 10) and np.isfinite(train.dC).all()
    assert train.take(slice(2)).dC.shape == (2, 10) and train.d2C is None
    twice = folder / "data" / "twice"
    run(spec, [*SMALL, "loads=2"], twice, QUIET, workers=1)
    assert read_dataset(artefact_file(twice, "train.parquet")).d2C.shape == (6, 15)


def test_cables_push_where_they_may_not_go_slack(folder):
    """By a force that is the slope of the energy."""
    robot = load_scene_and_mesh(folder / "pipelines" / "bar" / "scene.yaml", folder / "data" / "bar" / "mesh")
    pushing, slack = (FiniteElements(*robot, 1e-11, slack=one)() for one in (False, True))
    before, there, after = (pushing.solve(displacement(np.array([at])), None, np.zeros(0)) for at in (-1.1, -1.0, -0.9))
    assert there.lambda_a[0] == pytest.approx((after.energy - before.energy) / 0.2, rel=1e-3) and there.lambda_a[0] < 0
    let = slack.solve(displacement(np.array([-1.0])), None, np.zeros(0))
    assert let.slack.all() and let.lambda_a[0] == pytest.approx(0.0, abs=1e-9) and not there.slack.any()


def test_cables_that_push_need_the_box_of_displacements(spec, folder):
    with pytest.raises(SpecError, match="slack: false needs space: displacement"):
        run(spec, [*SMALL, "slack=false"], folder / "refused", QUIET, workers=1)


@pytest.mark.parametrize("key", ["material.density", "material.viscosity.relaxation"])
def test_a_parameter_of_motion_alone_needs_motion(folder, tmp_path, key):
    text = (folder / "pipelines" / "bar" / "scene.yaml").read_text()
    heavy = "material: {young: 1 MPa, poisson: 0.45, density: 1070 kg/m^3, viscosity: {relaxation: 10 ms}}"
    (tmp_path / "scene.yaml").write_text(text.replace("material: {young: 1 MPa, poisson: 0.45}", heavy))
    ends = {"density": "{kg/m^3: [1000, 1200]}", "relaxation": "{ms: [5, 20]}"}[key.split(".")[-1]]
    lines = ["scene: scene.yaml", f"mesh: {folder}/data/bar/mesh", "out: samples"]
    lines += ["splits: {train: {rows: 4, method: random}}", f"parameters: {{it: {{key: {key}, range: {ends}}}}}"]
    (tmp_path / "sample.yaml").write_text("\n".join(lines))
    with pytest.raises(SpecError, match=r"parameters\.it: .* changes no state of the robot at rest"):
        run(tmp_path / "sample.yaml", [], None, QUIET, workers=1)


def test_a_parameter_that_changes_nothing_is_called_so(folder, spec):
    """The tip lies on the body, which carries it itself."""
    keys = ("effectors.0.carrier_radius", "effectors.0.radius")
    ranges = ", ".join(f"p{i}: {{key: {key}, range: {{mm: [1.5, 2.5]}}}}" for i, key in enumerate(keys))
    overrides = [*SMALL, "skin=null", f"parameters={{{ranges}}}"]
    results = run(spec, overrides, folder / "idle", QUIET, workers=1)["results"]
    (finding,) = results["judgement"]
    assert finding["what"].startswith("parameter 'p0' (effectors.0.carrier_radius) changes nothing in any state")


def test_derivatives_of_the_rows_of_the_skin_are_those_of_their_compliance(folder, spec):
    """dW of all rows by differences of W between two states of the dataset near each other, and of loads beside it."""
    out = folder / "third"
    near = ["space=displacement", "splits.test.method=grid", "splits.test.rows=9", "third_order=true", "loads=true"]
    run(spec, [*SMALL, *near], out, QUIET, workers=1)
    test = read_dataset(artefact_file(out, "test.parquet"))
    whole = test.with_skin
    assert test.dC is not None and whole.dW.shape == (9, 1, whole.rows.n, whole.rows.n)
    lam, W, dW = test.lambda_a[:, 0], whole.W, whole.dW[:, 0]
    by_hermite = (W[2:] - W[:-2]) / (lam[2:] - lam[:-2])[:, None, None]
    weights = (dW[:-2] + 4 * dW[1:-1] + dW[2:]) / 6  # Simpson's rule: exact to the fourth order of the spacing
    np.testing.assert_allclose(weights, by_hermite, atol=2e-2 * np.abs(by_hermite).max())
