"""A wrong answer that calls itself converged must be caught, whatever is wrong with it."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from cfem.equilibrium.system.actuation import displacement, force
from cfem.equilibrium.system.solution import Status
from cfem.stability.bodies import bar
from cfem.stability.case import Case, converges
from cfem.stability.evidence import misbehaviours
from cfem.stability.examine import attempt
from cfem.stability.families.buckling import arch

RIGHT = Case("right", converges(), lambda: None)


@pytest.fixture(scope="module")
def trial():
    return attempt(bar, displacement([3.0, 2.0]))()


@pytest.fixture(scope="module")
def rigid():
    def with_rigid_end():
        made = bar()
        return replace(made, rigid=(np.flatnonzero(made.body.mesh.X[:, 0] > 49),))

    return attempt(with_rigid_end, displacement([3.0, 2.0]))()


def tampered(trial, **changes):
    return replace(trial, answer=replace(trial.answer, **changes))


def moved(trial, node, by):
    x = trial.answer.state.x.copy()
    x[node] += by
    return tampered(trial, state=replace(trial.answer.state, x=x))


def nudged(trial):
    return moved(trial, np.flatnonzero(trial.robot.body.mesh.X[:, 0] > 50)[0], 1e-4)


def with_W(trial, change):
    W = change(trial.answer.condensed.W.copy())
    return tampered(trial, condensed=replace(trial.answer.condensed, W=W))


def skewed(W):
    W[0, 4] *= 1.001
    return W


def infected(W):
    W[1, 1] = np.nan
    return W


def complaints(trial):
    return misbehaviours(RIGHT, trial.evidence())


def test_right_answers_stand(trial, rigid):
    assert complaints(trial) == [] and complaints(rigid) == []
    found = trial.evidence()
    assert found.residual < 1e-9 and found.asymmetry < 1e-9 and found.condition > 1 and found.smallest_eigenvalue > 0


WRONG = {
    "a free node moved": (nudged, "residual"),
    "a held node moved": (lambda t: moved(t, t.robot.fixed[0], 1e-6), "held nodes"),
    "an element inverted": (lambda t: moved(t, t.robot.body.mesh.cells[-1, 0], 20.0), "inverted"),
    "rounding blamed": (lambda t: tampered(nudged(t), rounding=1.0), "stated rounding level"),
    "another displacement": (lambda t: replace(t, actuation=displacement([3.001, 2.0])), "displacement missed"),
    "another force": (lambda t: replace(t, actuation=force(t.answer.state.lam * 1.001)), "force missed"),
    "W not symmetric": (lambda t: with_W(t, skewed), "asymmetry of W as given"),
    "W too large": (lambda t: with_W(t, lambda W: 1.01 * W), "differences of the residual"),
    "W negative": (lambda t: with_W(t, lambda W: -W), "not positive definite"),
    "W with a NaN": (lambda t: with_W(t, infected), "not finite"),
    "energy NaN": (lambda t: tampered(t, energy=np.nan), "not finite"),
    "delta_free off": (
        lambda t: tampered(t, condensed=replace(t.answer.condensed, delta_free=t.answer.condensed.delta_free + 1e-3)),
        "W lambda + delta_free",
    ),
    "failed": (lambda t: tampered(t, status=Status.STEP_TOO_SMALL), "not STEP_TOO_SMALL"),
    "failed with a NaN": (lambda t: tampered(t, status=Status.OUT_OF_REACH, energy=np.nan), "not finite"),
}


@pytest.mark.parametrize("tamper, word", WRONG.values(), ids=WRONG.keys())
def test_a_wrong_answer_is_caught(trial, tamper, word):
    assert any(word in sentence for sentence in complaints(tamper(trial))), complaints(tamper(trial))


def test_a_rigid_body_that_has_been_strained_is_caught(rigid):
    assert any("within rigid bodies" in each for each in complaints(moved(rigid, rigid.robot.rigid[0][3], 1e-6)))


def test_a_cable_that_pushes_is_caught():
    pushing = attempt(partial(bar, unilateral=False), displacement([-3.0, 1.0]))()
    assert complaints(pushing) == []
    unilateral = replace(pushing.robot, unilateral=np.array([True, True]))
    assert any("push" in each for each in complaints(replace(pushing, robot=unilateral)))


def test_an_unstable_equilibrium_called_stable_is_caught():
    """An arch on its way down, held by its displacement, would not stay there under the same force."""
    held = attempt(partial(arch, "tet10p0"), displacement([4.0]))()
    assert held.answer.converged and held.answer.condensed.W_aa[0, 0] < 0
    assert not [check for check in held.evidence().checks if not check.passed]
    under_force = replace(held, actuation=force(held.answer.state.lam))
    assert any("unstable" in each for each in complaints(under_force))
