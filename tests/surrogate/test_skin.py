"""The whole surface from a model, against finite elements of the bar that the model never saw."""

from dataclasses import replace

import numpy as np
import pytest

import cfem
from cfem.condensed.skin import read_skin
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import InputError, NumericalError
from cfem.mechanics.body import response
from cfem.predict.load import build, skin_of
from cfem.surrogate.definiteness import smallest_eigenvalue
from cfem.surrogate.model_card import model_card
from cfem.surrogate.skin import fit_skin, judge
from cfem.surrogate.verdict import headline


@pytest.fixture(scope="module")
def states(bar):
    return {split: cfem.read_dataset(bar / "data" / "bar" / "samples", split) for split in ("train", "test")}


@pytest.fixture(scope="module")
def skin(bar):
    return read_skin(bar / "data" / "bar" / "samples" / "skin.npz")


def test_the_surface_is_that_of_finite_elements_as_training_says(bar, model, states, skin):
    """At the test states, solved here again."""
    robot = cfem.load_robot(bar / "pipelines" / "bar" / "scene.yaml", bar / "data" / "bar" / "mesh")
    said = read_manifest(bar / "models" / "bar" / "spectral")["results"]["skin"]
    squares, largest = [], 0.0
    for delta_a in states["test"].delta_a:
        true = cfem.solve(robot, displacement=delta_a).state.x[skin.nodes]
        apart = np.linalg.norm(model.shape(delta_a) - true, axis=1)
        squares.append(skin.weights @ apart**2)
        largest = max(largest, apart.max())
    assert np.sqrt(np.mean(squares)) == pytest.approx(said["rms_mm"], rel=1e-3)
    assert 0.5 * said["largest_mm"] < largest <= said["largest_mm"] < 1e-3 * model.length


def test_shapes_of_many_states_are_those_of_each(model):
    for wrong in ([1.0, 2.0], [np.nan], 1.0):
        with pytest.raises(InputError, match="one finite number for each actuator"):
            model.shape(wrong)
    with pytest.raises(NumericalError, match="far outside what the model was trained on"):
        model.shape([100.0])
    many = model.shape([[[1.0], [2.0]], [[3.0], [0.0]]])
    assert many.shape == (2, 2, *model.skin.rest.shape)
    np.testing.assert_allclose(many[1, 0], model.shape([3.0]), atol=1e-12)
    np.testing.assert_allclose(many[1, 1], model.skin.rest, atol=5e-3)
    assert model.facets.max() < len(model.skin.rest)


def test_all_rows_of_W_and_their_displacements_are_those_of_the_test_states(model, states):
    whole, test = states["test"].with_skin, states["test"]
    for i, delta_a in enumerate(test.delta_a):
        found = model.whole(delta_a)
        assert found.rows == whole.rows
        np.testing.assert_allclose(found.W, whole.W[i], atol=2e-3 * np.abs(whole.W[i]).max())
        np.testing.assert_allclose(found.delta_s, whole.delta_s[i], atol=1e-3)
        np.testing.assert_allclose(found.W, found.W.T, rtol=1e-12, atol=1e-12)
        assert smallest_eigenvalue(found.W[None])[0] > -1e-13
        own = np.r_[found.rows.e, found.rows.active]
        np.testing.assert_array_equal(found.W[np.ix_(own, own)], model.at_displacement(delta_a).W)


@pytest.mark.parametrize("third_order", [False, True])
def test_a_model_of_forces_has_the_same_rows(model, states, skin, third_order):
    """At the forces of a state, against the model of displacements; with derivatives of W or without."""
    train, test = states["train"], states["test"]
    if third_order:  # no sample of the bar has them: those of the model of displacements, by differences
        h = 1e-3 * np.ptp(train.lambda_a)
        ahead, behind = ([model.at_force(lam + sign * h) for lam in train.lambda_a] for sign in (1, -1))
        wholes = [[model.whole(one.delta_a).W for one in side] for side in (ahead, behind)]
        dW = (np.array(wholes[0]) - np.array(wholes[1]))[:, None] / (2 * h)
        own = np.r_[train.with_skin.rows.e, train.with_skin.rows.active]
        whole = replace(train.with_skin, dW=dW)
        train = replace(train, dW=dW[:, :, own[:, None], own], with_skin=whole)
    arrays = fit_skin(train, skin, "force", {})
    card = model_card("spectral", train, "force")
    found = skin_of(_Bare(card), arrays)
    np.testing.assert_allclose(found.rows(test.lambda_a, test.p), test.with_skin.delta_s, atol=5e-3)
    gradient = found.gradient(test.lambda_a, test.p)
    true = test.with_skin.W[:, test.with_skin.rows.s, test.with_skin.rows.a]
    np.testing.assert_allclose(gradient, true, atol=2e-3 * np.abs(true).max())


class _Bare:
    """What `skin_of` asks of a predictor."""

    def __init__(self, card):
        from cfem.condensed import Rows

        self.form, self.n_inputs = card["form"], len(card["rows"]["actuators"])
        self.rows = Rows(tuple(card["rows"]["effectors"]), tuple(card["rows"]["actuators"]))


def test_the_front_is_what_fewer_modes_leave(model, states):
    test = states["test"]
    front = judge(model.skin, test.with_skin, test.delta_a, test.p)
    assert len(front.rms) == len(model.skin) + 1 and (np.diff(front.rms) < 1e-9).all()
    moved = np.sqrt((test.with_skin.delta_s**2).sum(axis=1) + test.with_skin.left[:, 0] ** 2)
    assert front.rms[0] == pytest.approx(np.sqrt(np.mean(moved**2)), rel=1e-5)  # modes in single precision
    assert all(one <= other for one, other in zip(front.rms, front.largest, strict=True))


def test_training_says_how_good_the_shape_is_and_leaves_it_out_when_told(bar, model, tmp_path):
    spec = bar / "pipelines" / "bar" / "train.yaml"
    results = read_manifest(bar / "models" / "bar" / "spectral")["results"]
    assert any(
        line.startswith(f"skin: the largest error of {len(model.skin.rest)} surface nodes is ")
        for line in headline(results, {})
    )
    cfem.run_stage("train", spec, out=tmp_path / "plain", overrides=["skin=false"])
    assert not (tmp_path / "plain" / "skin.npz").exists()
    with pytest.raises(InputError, match=r"has no skin.*sample it with `skin"):
        cfem.load_model(tmp_path / "plain").shape([1.0])


def test_a_model_that_is_no_folder_has_no_skin(model):
    meta = model.meta
    with pytest.raises(InputError, match="has no skin"):
        build(meta, model.arrays).shape([1.0])


def test_samples_of_another_skin_than_their_file_are_refused(bar, tmp_path, states):
    from cfem.surrogate import stage

    train, test = states["train"], states["test"]
    other = replace(train, with_skin=replace(train.with_skin, sha256="0" * 64))
    with pytest.raises(InputError, match="another skin than its file holds"):
        stage.add_skin(tmp_path, None, {}, other, test, bar / "data" / "bar" / "samples")


KINDS = {
    "mlp": ("{kind: mlp, width: 16, depth: 1, epochs: 5}", 5e-3),
    "spectral of forces": ("{kind: spectral, form: force}", 5e-3),
}


@pytest.mark.parametrize("name", KINDS)
def test_models_of_every_kind_have_the_shape_of_finite_elements(bar, states, skin, tmp_path, name):
    """The skin is learned beside the model; a model of forces is first asked which forces hold the displacements."""
    model, within = KINDS[name]
    spec = bar / "pipelines" / "bar" / "train.yaml"
    cfem.run_stage("train", spec, out=tmp_path / "one", overrides=[f"model={model}"])
    found, test = cfem.load_model(tmp_path / "one"), states["test"]
    assert found.shape(test.delta_a).shape == (len(test), *skin.rest.shape)
    true = skin.rest + skin.displacements(test.with_skin.delta_s)
    apart = np.linalg.norm(found.shape(test.delta_a) - true, axis=2)
    assert apart.max() < within + 2 * test.with_skin.left[:, 1].max()


def test_the_shape_of_other_materials_is_theirs_and_of_other_bodies_refused(bar, bar_of_any_material):
    """A sampled Poisson's ratio, and Young's modulus, which is exact; a geometry that moves the nodes has no shape."""
    specs = bar / "pipelines" / "bar"
    model = cfem.load_model(bar_of_any_material)
    for poisson in (0.31, 0.44):
        robot = cfem.load_robot(
            specs / "scene.yaml", bar / "data" / "bar" / "mesh", overrides=[f"material.poisson={poisson}"]
        )
        true = cfem.solve(robot, displacement=[4.0]).state.x[model.skin.nodes]
        p = np.array([poisson if one.name == "poisson" else one.reference for one in model.parameters])
        apart = np.linalg.norm(model.shape([4.0], p) - true, axis=1).max()
        other = np.linalg.norm(model.shape([4.0], np.where(p == poisson, 0.75 - poisson, p)) - true, axis=1).max()
        assert apart < 5e-3 and other > 3 * apart
    moved = replace(model.parameters[0], key="geometry.length")
    model.parameters = (moved, *model.parameters[1:])
    with pytest.raises(InputError, match=f"the shape of other designs is not known: '{moved.name}' changes where"):
        model.shape([4.0], p)


def test_all_nodes_on_request_are_those_of_finite_elements(bar, model, tmp_path):
    """At unseen states; and the elastic energy of the nodes so placed, which stands for their strains."""
    specs = bar / "pipelines" / "bar"
    with pytest.raises(InputError, match=r"no nodes inside the body \(sample it with `skin: {inner: true}`"):
        model.all_nodes([1.0])
    asked = ["skin.inner=true"]
    cfem.run_stage("sample", specs / "sample.yaml", out=tmp_path / "samples", overrides=asked, workers=1)
    cfem.run_stage("train", specs / "train.yaml", out=tmp_path / "model", overrides=[f"dataset={tmp_path / 'samples'}"])
    whole = cfem.load_model(tmp_path / "model")
    robot = cfem.load_robot(specs / "scene.yaml", bar / "data" / "bar" / "mesh")
    said = read_manifest(tmp_path / "samples")["results"]["skin"]["inner"]
    assert said["nodes"] == len(robot.X) - len(whole.skin.nodes) > 0 and said["largest_mm"] < 0.02
    for delta in ([1.7], [4.3]):
        solved = cfem.solve(robot, displacement=delta)
        found = whole.all_nodes(delta)
        np.testing.assert_allclose(found[whole.skin.nodes], whole.shape(delta), atol=1e-12)
        assert np.linalg.norm(found - solved.state.x, axis=1).max() < 0.02
        energy = response(robot.body, found, np.empty(0)).energy
        assert energy == pytest.approx(response(robot.body, solved.state.x, np.empty(0)).energy, rel=0.01)
    many = whole.all_nodes([[1.7], [4.3]])
    np.testing.assert_allclose(many[1], whole.all_nodes([4.3]), atol=1e-12)
