"""Dexterity and strength against what they mean, and the user's own functions."""

import numpy as np
import pytest
from design.problems import REFERENCE, TIP, finger
from parametric.synthetic import ROWS, Arc

from cfem.condensed import Rows
from cfem.core.errors import NumericalError, SpecError
from cfem.design.objectives import Dexterity, OwnFunction, Strength, load_function, position_rows

P = np.array([[35.0, 0.42, 3.0], [45.0, 0.48, 3.0]])
STATES = Arc().at("displacement", np.array([[10.0]]), P)


def test_dexterity_is_the_angle_of_the_tip_from_a_right_angle():
    own = Dexterity(TIP, 2, np.pi / 2, None)(STATES)
    for i in range(2):
        tip, rest = STATES.x_e[i], STATES.rest_e[i]
        assert own[i] == pytest.approx(abs(np.pi / 2 - np.arccos(tip[2] / np.linalg.norm(rest))))
    fixed = np.array([0.0, 10.0, -40.0])
    same = Dexterity(TIP, 2, np.pi / 2, fixed)(STATES)
    assert same[0] == pytest.approx(abs(np.pi / 2 - np.arccos(STATES.x_e[0, 2] / np.hypot(10, 40))))
    assert same[0] < own[0] and same[1] > own[1]  # one point for all favours short fingers


@pytest.mark.parametrize("rest", [None, np.array([0.0, 11.0, -39.0])])
def test_strength_is_the_force_that_holds_the_tip(rest):
    """Against the bordered system of all rows: W lambda + delta_free, actuators and tip prescribed."""
    strength = Strength(TIP, 1, 91.0, rest)
    force = strength.force(STATES)
    for i in range(2):
        W, free = STATES.W[i], STATES.delta_free[i]
        held = np.zeros(3) if rest is None else rest - STATES.rest_e[i]
        lam = np.linalg.solve(W, np.append(held, 10.0) - free)
        assert force[i] == pytest.approx(lam[:3], rel=1e-9)
        formula = W[:3, 3:] @ np.linalg.solve(W[3:, 3:], W[3:, :3]) - W[:3, :3]
        shifted = free[:3] - held
        right = W[:3, 3:] @ np.linalg.solve(W[3:, 3:], 10.0 - free[3:]) + shifted
        assert force[i] == pytest.approx(np.linalg.solve(formula, right), rel=1e-9)
    assert strength(STATES) == pytest.approx(91.0 - np.abs(force[:, 1]))


def test_slopes_are_those_of_finer_differences_and_exact_parameters_scale():
    problem = finger(free=(0, 1, 2))
    z = np.array([0.3, 0.6, 0.5])
    _, slopes = problem.with_slopes(z)
    h = 1e-5
    for i in range(3):
        ahead, behind = (np.hstack(problem((z + sign * h * np.eye(3)[i])[None]))[0] for sign in (1, -1))
        assert slopes[:, i] == pytest.approx((ahead - behind) / (2 * h), rel=1e-6, abs=1e-9)
    force = 91.0 - problem(z[None]).objectives[0, 1]
    assert slopes[0, 2] == pytest.approx(0, abs=1e-10)  # no angle depends on the modulus
    assert slopes[1, 2] == pytest.approx(-force * np.log(10), rel=1e-9)  # forces are proportional to it


def test_a_users_function_in_a_file_or_a_module(tmp_path):
    (tmp_path / "mine.py").write_text("def stiff(W, delta_free, p):\n    return W[:, 3, 3] * p[:, 2]\n")
    own = OwnFunction("objectives.mine", load_function("mine.py:stiff", tmp_path, "here"), -1.0)
    assert own(STATES) == pytest.approx(-STATES.W[:, 3, 3] * 3.0)
    assert load_function("math:sqrt", tmp_path, "here")(4) == 2


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("sqrt", "does not name a function"),
        ("none.py:f", "cannot be loaded"),
        ("math:nothing", "cannot be loaded"),
        ("no_such_module:f", "cannot be loaded"),
    ],
)
def test_a_function_that_is_not_there(tmp_path, reference, message):
    with pytest.raises(SpecError, match=f"objectives.mine: .*{message}"):
        load_function(reference, tmp_path, "objectives.mine")


def test_a_users_function_that_fails_says_with_what():
    with pytest.raises(SpecError, match=r"ZeroDivisionError with W \(2, 4, 4\)"):
        OwnFunction("objectives.mine", lambda W, free, p: 1 / 0)(STATES)
    with pytest.raises(SpecError, match=r"shape \(\) for 2 designs"):
        OwnFunction("objectives.mine", lambda W, free, p: 1.0)(STATES)
    with pytest.raises(NumericalError, match="not finite"):
        OwnFunction("objectives.mine", lambda W, free, p: p[:, 0] * np.nan)(STATES)


def test_effectors_are_found_by_name():
    rows = Rows(("a.x", "a.y", "a.z", "b.x", "b.y", "b.z"), ("c",))
    assert position_rows(rows, "b", "here").tolist() == [3, 4, 5]
    assert position_rows(ROWS, None, "here").tolist() == [0, 1, 2]
    with pytest.raises(SpecError, match=r"no effector 'd'.*known are a, b"):
        position_rows(rows, "d", "here")
    assert len(REFERENCE) == len(Arc.parameters)
