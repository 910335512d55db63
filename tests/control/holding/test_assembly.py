"""Control of held objects begins where the model has data, and with the preload or what balances it."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.blocks import bar

from cfem.condensed import Rows
from cfem.contact.obstacle import Box
from cfem.control.holding import assembly
from cfem.control.holding.assembly import (
    LONGEST,
    TOUCHES,
    _demand_touch,
    _stable,
    _taut_state,
    gripped,
)
from cfem.control.holding.body import box_body
from cfem.control.holding.spec import RobotSpec
from cfem.core.errors import InputError, NumericalError


def test_it_begins_at_the_training_state_nearest_to_the_middle_of_their_box():
    """Two actuators and a pose of one coordinate; in shares of each range, the third state is 0.1 off."""
    displacements = np.array([[0.0, 0.0, 5.0], [10.0, 2.0, 7.0], [4.0, 1.0, 6.2], [2.0, 1.9, 5.0]])
    states = np.hstack([displacements, np.zeros((4, 3))])
    predictor = SimpleNamespace(domain=SimpleNamespace(states=states))
    np.testing.assert_array_equal(_taut_state(predictor, 1), [4.0, 1.0])


@pytest.mark.parametrize(
    ("holds", "expected"), [([1.0], 1.0), ([0.5, 0.3], 0.5), ([0.25], 0.25), ([0.0], 0.0), ([0.1], None)]
)
def test_robots_begin_as_taut_as_they_hold_the_object(monkeypatch, holds, expected):
    taut, tried = np.array([2.0, 4.0]), []

    class Coupled:
        def __init__(self, *of):
            assert of == ("robots", "object")

        def at_displacement(self, delta):
            tried.append(delta[0] / 2.0)
            if tried[-1] not in holds:
                raise NumericalError("nobody holds it")

    monkeypatch.setattr("cfem.control.holding.assembly.Coupled", Coupled)
    if expected is None:
        with pytest.raises(NumericalError, match="nobody holds it"):
            _stable("robots", "object", taut)
        assert tried == [1.0, 0.5, 0.25, 0.0]
        return
    np.testing.assert_array_equal(_stable("robots", "object", taut), expected * taut)
    assert tried == [share for share in (1.0, 0.5, 0.25, 0.0) if share >= expected]


@pytest.mark.parametrize(
    ("table", "gap", "said"),
    [
        (False, 0.0, None),
        (False, 0.99 * TOUCHES, None),
        (False, 0.5, "contact point 'tip' of robot 'right' does not reach the object: 0.5 mm are missing"),
        (False, -0.5, "contact point 'tip' of robot 'right' is 0.5 mm inside the object"),
        (True, 0.5, None),
        (True, -0.5, "contact point 'tip' of robot 'right' is 0.5 mm inside the object"),
    ],
)
def test_contact_points_that_do_not_touch_the_object_are_named(table, gap, said):
    """The second point of the second robot, beside a box of 4 mm; others touch it."""
    spec = SimpleNamespace(
        object=SimpleNamespace(table=table), robots=[SimpleNamespace(name=name) for name in ("left", "right")]
    )
    robot = SimpleNamespace(rows=SimpleNamespace(contacts=tuple(f"{at}.{k}" for at in ("base", "tip") for k in "xyz")))
    fingers = [
        SimpleNamespace(points=np.array([[-2.0, 0.0, 0.0], [-2.0, 1.0, 0.0]])),
        SimpleNamespace(points=np.array([[2.0, 0.0, 0.0], [2.0 + gap, 1.0, 0.0]])),
    ]
    shape = Box(np.full(3, 2.0))
    if said is None:
        _demand_touch(spec, robot, shape, fingers)
        return
    with pytest.raises(InputError, match=said):
        _demand_touch(spec, robot, shape, fingers)


CENTRE, HALF = [30.0, 5.0, 12.0], [4.0, 4.0, 3.0]
ROBOTS = [
    RobotSpec(name="below"),
    RobotSpec(name="above", rotate={"axis": [1, 0, 0], "angle": "180 deg"}, translate={"mm": [0, 10, 24]}),
]
BODY = box_body(CENTRE, HALF)


def spec(law="coulomb", preload=0.5, **more):
    about = {"law": law, "friction": 0.8, "half_size": HALF, "centre": CENTRE, "force": np.array([0.0, 0.0, -5e-3])}
    about |= {"turns": False, "balanced": False, "table": False, "margin": 1.5} | more
    search = SimpleNamespace(preload=preload)
    return SimpleNamespace(object=SimpleNamespace(**about), search=search, robots=ROBOTS, oriented=False)


@pytest.fixture(scope="module")
def robot():
    return bar(element="hex8", cables=2, contact=True, divisions=(4, 2, 2))


@pytest.fixture
def asked(monkeypatch):
    """What plans are made of, in place of those that finite elements and learned robots take a while to make."""
    calls = {"table": [], "air": []}
    monkeypatch.setattr(assembly, "patch_of", lambda points, turns: ("patch", turns))
    monkeypatch.setattr(assembly, "within_patch", lambda robot, patch: ())
    monkeypatch.setattr(assembly, "WithinPatch", lambda *of: "within")
    monkeypatch.setattr(assembly, "LearnedFinger", lambda *of: SimpleNamespace(of=of, points=np.zeros((1, 3))))
    monkeypatch.setattr(assembly, "balanced", lambda learned, held, counts, preload: np.arange(4.0) * preload)
    monkeypatch.setattr(assembly, "margin_of", lambda robots: 7.0)

    def plans(kind):
        def made(*given):
            calls[kind].append(given)
            return SimpleNamespace(home=np.full(4, 0.125), kind=kind)

        return made

    monkeypatch.setattr(assembly, "from_table", plans("table"))
    monkeypatch.setattr(assembly, "Gripping", plans("air"))
    monkeypatch.setattr(assembly.Grip, "of", lambda first, fe: ("grip", first, fe))
    return calls


def glued(n_pose=6):
    holds = [SimpleNamespace(model=f"model {i}", turn=i, shift=-i, n_pose=n_pose) for i in range(2)]
    return {"spectral": SimpleNamespace(holds=holds, rows=Rows(("x", "y", "z"), tuple("abcd")))}


@pytest.mark.parametrize("balanced", [False, True])
@pytest.mark.parametrize("table", [False, True])
def test_plans_begin_with_the_preload_or_what_balances_it(robot, asked, balanced, table):
    models = glued()
    grip, plans, fe = gripped(spec(balanced=balanced, table=table), BODY, robot, models)
    (given,), none = asked["table" if table else "air"], asked["air" if table else "table"]
    assert not none and grip == ("grip", plans["spectral"], fe)
    robots, of, names, mu, margin, grasp, last = given
    assert (
        of is models["spectral"].rows
        and names == ("below", "above")
        and (mu, margin, last) == (0.8, 1.5, 0.5 if table else 7.0)
    )
    np.testing.assert_array_equal(grasp, 0.5 * np.arange(4.0) if balanced else np.full(4, 0.5))
    np.testing.assert_array_equal(robots._grasp, grasp)
    assert [finger.of for finger in robots.fingers] == [
        (f"model {i}", ("patch", True), "within", i, -i) for i in range(2)
    ]
    np.testing.assert_array_equal(fe._grasp, np.full(4, 0.125))  # where plans are at home
    for plant in (robots, fe):
        assert (plant.table is not None) == table and plant._margin == 1.5 and plant._mu == 0.8
        np.testing.assert_array_equal(plant._ends, [0, 2, 4])
        np.testing.assert_allclose(plant._longest, LONGEST * 8.0)  # of the reach
        np.testing.assert_array_equal(plant.load_of_object, [0, 0, -5e-3])
    if table:
        np.testing.assert_allclose(fe.table.points[:, 2], 9.0)
    np.testing.assert_allclose(fe.fingers[1].points, [[30.0, 5.0, 15.0]])  # turned and shifted


def test_without_preload_nothing_is_squeezed(robot, asked):
    _, _, fe = gripped(spec(preload=0.0), BODY, robot, glued())
    assert fe._grasp is None


def test_glued_points_have_no_grip_and_models_as_they_are(robot, asked):
    models = glued(3)
    grip, plans, fe = gripped(spec("bilateral", force=None), BODY, robot, models)
    assert grip is None and plans is models and fe.glued and fe._mu == 0.0 and fe.table is None
    np.testing.assert_array_equal(fe.load_of_object, np.zeros(3))


def test_points_that_open_need_a_patch_that_turns(robot, asked):
    with pytest.raises(InputError, match="sampled with one that cannot"):
        gripped(spec(), BODY, robot, glued(5))
    gripped(spec(), BODY, robot, glued(6))
