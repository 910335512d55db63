"""The whole robot and who pushes it from a few markers: against the model's own states, and against finite elements."""

import numpy as np
import pytest

from cfem.contact.surface.triangles import closest
from cfem.core.errors import InputError
from cfem.plant.fem_plant import FemPlant, pushed
from cfem.predict.estimation.estimate import Estimator
from cfem.predict.estimation.fit import EstimateStatus
from cfem.predict.estimation.markers import markers_near
from cfem.predict.load import load_model
from cfem.predict.loads.loaded import wrench_of
from cfem.robot.build import build_robot
from cfem.robot.load import load_scene_and_mesh

TIP = ("tip.x", "tip.y", "tip.z")
NOISE, SENSOR = 0.1, 0.05


@pytest.fixture(scope="module")
def estimator(model):
    return Estimator(model, markers_near(model, 5), NOISE, TIP, largest=0.02, sensor=SENSOR)


def seen(estimator, x, rng=None):
    """Markers (m, 3) mm at unknowns x by the model itself, with noise where a generator is given."""
    rows, _ = estimator.mode_series(*estimator.split(np.asarray(x, float)))
    phi, _ = estimator.series.nearest
    places = phi @ estimator.model.skin.surface(rows)
    return places if rng is None else places + NOISE * rng.normal(size=places.shape)


def test_without_noise_it_finds_the_state(estimator):
    x = np.array([3.0, 0.0, 0.005, -0.003])
    found = estimator.estimate(seen(estimator, x), [3.0])
    assert found.converged and not found.outliers
    assert found.delta_a[0] == pytest.approx(3.0, abs=0.02)
    assert np.abs(found.loads - x[1:]).max() < 2e-3


def test_the_derivatives_of_what_is_seen_against_differences(estimator):
    x, h = np.array([3.0, 0.001, 0.005, -0.003]), 1e-5
    _, slope = estimator.mode_series(*estimator.split(x))
    for n in range(4):
        ahead, behind = (estimator.mode_series(*estimator.split(x + sign * h * np.eye(4)[n]))[0] for sign in (1, -1))
        assert np.allclose(slope[:, n], (ahead - behind) / (2 * h), rtol=1e-4, atol=1e-6)


def test_intervals_cover(estimator):
    """95 % intervals of forces drawn as assumed hold the truth in 90 to 99 % of 200 numbers an unknown."""
    rng, inside = np.random.default_rng(0), []
    for _ in range(200):
        x = np.concatenate([rng.uniform(1, 6, 1), 0.02 * rng.normal(size=3)])
        found = estimator.estimate(seen(estimator, x, rng), x[:1] + SENSOR * rng.normal(size=1))
        z = (np.concatenate([found.delta_a, found.loads]) - x) / np.sqrt(np.diag(found.covariance))
        inside.append(np.abs(z) < 1.96)
    share = np.mean(inside, axis=0)
    assert (share > 0.9).all() and (share < 0.995).all()


def test_the_shape_and_the_push_of_finite_elements(bar, model, estimator):
    robot = build_robot(*load_scene_and_mesh(bar / "pipelines" / "bar" / "scene.yaml"))
    push = np.array([0.0, 0.006, -0.004])
    plant = FemPlant(pushed(robot, wrench_of(model.rows, {"tip": push})))
    plant.at_displacement([3.0])
    surface = plant.x[model.skin.nodes]
    rng = np.random.default_rng(1)
    markers = estimator.series.nearest[0] @ surface + NOISE * rng.normal(size=estimator.markers.shape)
    found = estimator.estimate(markers, [3.0])
    assert found.converged
    apart = model.skin.surface(found.rows) - surface
    assert np.sqrt((apart**2).sum(axis=1).mean()) < 0.3
    assert np.abs(found.loads[1:] - push[1:]).max() < 0.15 * np.linalg.norm(push)
    assert np.linalg.norm(found.delta_e - plant.state.delta_e) < 0.3


def test_missing_markers_and_outliers_are_survived(estimator):
    x, rng = np.array([4.0, 0.0, 0.004, 0.002]), np.random.default_rng(2)
    measured = seen(estimator, x, rng)
    measured[1] = np.nan
    measured[3] += [6.0, -4.0, 8.0]
    found = estimator.estimate(measured, [4.0])
    assert found.converged and found.outliers == (3,)
    assert (
        np.linalg.norm(
            estimator.model.skin.surface(found.rows)
            - estimator.model.skin.surface(estimator.mode_series(*estimator.split(x))[0]),
            axis=1,
        ).max()
        < 1.0
    )


def test_any_two_of_eight_markers_may_be_wrong_and_one_missing(model):
    """From no knowledge of the state: 60 draws, each found within its intervals, and the wrong markers named."""
    estimator = Estimator(model, markers_near(model, 8), NOISE, TIP[1:], 0.02)
    for seed in range(60):
        rng = np.random.default_rng(seed)
        x = np.concatenate([rng.uniform(0.5, 6.0, 1), 0.02 * rng.normal(size=2)])
        measured = estimator.places(x) + NOISE * rng.normal(size=(8, 3))
        chosen = rng.permutation(8)
        measured[chosen[:2]] += 15.0 * rng.normal(size=(2, 3))
        measured[chosen[2]] = np.nan
        found = estimator.estimate(measured)
        assert found.converged and set(found.outliers) == set(chosen[:2].tolist())
        assert (np.abs(np.concatenate([found.delta_a, found.loads]) - x) < 5 * found.deviation).all()
        assert found.iterations <= 30


def test_wrong_markers_are_looked_for_from_the_state_nearest_to_half_of_the_markers(estimator):
    """The first guess where that is nearest, and else a state of the training data, without loads."""
    x, far = np.array([3.3, 0.0, 0.02, -0.03]), np.array([6.0, 0.0, 0.06, 0.06])
    moved, seen = estimator.from_rest(estimator.places(x) + np.repeat([[0, 0, 0], [90, 0, 0]], [3, 2], axis=0))
    np.testing.assert_array_equal(estimator._nearest_state(moved, seen, x), x)
    states, places = estimator.starts
    number = int(np.argmax(np.abs(states[:, 0] - 6.0)))
    nearest = estimator._nearest_state(places[number], seen, far)
    np.testing.assert_array_equal(nearest, np.r_[states[number], 0.0, 0.0, 0.0])
    blind = seen & (np.arange(5) != 1)
    moved[1] = 1e9
    np.testing.assert_array_equal(estimator._nearest_state(moved, blind, x), x)


def test_markers_of_which_half_are_wrong_have_no_answer(estimator):
    measured = seen(estimator, np.array([3.0, 0.0, 0.0, 0.0]))
    measured[:3] += [[30.0, 0, 0], [0, -25.0, 0], [0, 0, 40.0]]
    assert estimator.estimate(measured).status is EstimateStatus.OUTLIERS


def test_what_nothing_measures_is_named(model):
    """Five markers tell nothing of a push along the stiff axis; without markers of any kind nothing is told."""
    found = Estimator(model, markers_near(model, 5), NOISE, TIP, 0.02).estimate(np.full((5, 3), np.nan), [2.0])
    assert set(TIP) <= set(found.unseen)
    alone = Estimator(model, markers_near(model, 1), NOISE, TIP, 0.02)
    assert alone.estimate(np.full((1, 3), np.nan)).status is EstimateStatus.TOO_FEW


def test_a_robot_of_another_material_is_estimated_by_its_own_compliance(bar_of_any_material):
    """Markers, tensions and effectors of a material against all rows of W of the model there (`whole`)."""
    model = load_model(bar_of_any_material)
    names = [one.name for one in model.parameters]
    p = np.array([{"poisson": 0.42, "young": 1.3}[name] for name in names])
    first = Estimator(model, markers_near(model, 5), NOISE, ("tip.y", "skin.2"), 0.02)
    at, w = np.array([2.5]), np.array([0.011, -0.02])
    first.estimate(first.places(np.concatenate([at, w])))  # what is kept of the reference must not stay
    found, x, whole = first.at(p), np.concatenate([at, w]), model.whole(at, p)
    rows = whole.rows
    loaded, s, a = [rows.names.index("tip.y"), rows.names.index("skin.2")], rows.s, rows.a
    locked = whole.W - whole.W[:, a] @ np.linalg.solve(whole.W_aa, whole.W[a])
    surface = model.skin.surface(model.skin.rows(at, model.q(p)) + locked[s][:, loaded] @ w)
    assert found.places(x) == pytest.approx(found.seen(surface), abs=1e-9)
    assert np.abs(found.places(x) - first.places(x)).max() > 0.1
    assert found.effectors(at, w) == pytest.approx(whole.delta_e + locked[rows.e][:, loaded] @ w)
    assert found.response(at).held @ w == pytest.approx(whole.W[rows.e][:, loaded] @ w, rel=1e-6)
    h, force = 1e-5, found.tension_rows(x)
    energy = [_energy(model, p, at, loaded, w, step) for step in (h, -h)]
    assert force[0][0] == pytest.approx((energy[0] - energy[1]) / (2 * h), rel=1e-6)


def _energy(model, p, at, loaded, w, step):
    """Psi - w . e - w . C w / 2 with e and C from `whole`, Psi by the model's own force: up to a constant."""
    here, middle = model.whole(at + step, p), model.whole(at + step / 2, p)
    a = here.rows.a
    locked = here.W - here.W[:, a] @ np.linalg.solve(here.W_aa, here.W[a])
    psi = step * middle.lambda_a[0]
    return psi - w @ here.delta[loaded] - w @ locked[np.ix_(loaded, loaded)] @ w / 2


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"loaded": ("top.x",)}, "no row 'top.x'"),
        ({"noise": 0.0}, "must be positive"),
        (
            {"markers": np.array([[0.0, 0.0, 500.0]])},
            r"the marker at \(0, 0, 500\) mm is .* mm off the surface at rest",
        ),
    ],
)
def test_wrong_input_gets_one_sentence(model, change, said):
    given = {"model": model, "markers": markers_near(model, 2), "noise": NOISE, "loaded": TIP}
    with pytest.raises(InputError, match=said):
        Estimator(**{**given, **change})


def test_markers_of_another_number_are_refused(estimator):
    with pytest.raises(InputError, match="expected 5 markers"):
        estimator.estimate(np.zeros((4, 3)))


def test_the_nearest_point_of_a_triangle_is_the_nearest_of_many():
    rng = np.random.default_rng(3)
    corners, point = rng.normal(size=(20, 3, 3)), rng.normal(size=3)
    bary, distance = closest(corners, point)
    assert np.allclose(bary.sum(axis=1), 1) and (bary >= -1e-12).all()
    assert np.allclose(np.linalg.norm(np.einsum("tc,tci->ti", bary, corners) - point, axis=1), distance)
    for shares in rng.dirichlet(np.ones(3), size=500):
        assert (np.linalg.norm(np.einsum("c,tci->ti", shares, corners) - point, axis=1) >= distance - 1e-12).all()
