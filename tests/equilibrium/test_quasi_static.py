import numpy as np

from cfem.equilibrium.quasi_static import carried_out


def test_a_command_is_cut_into_steps_no_longer_than_allowed():
    went = []
    status = carried_out(np.zeros(2), np.array([3.0, -1.0]), 1.0, lambda u: went.append(u) or "converged")
    assert status == "converged" and len(went) == 3
    assert np.allclose(went, [[1, -1 / 3], [2, -2 / 3], [3, -1]])


def test_a_step_that_fails_is_halved_and_the_next_grows_again():
    went = []

    def go(u):
        went.append(u[0])
        return "no" if u[0] > 0.5 and len(went) == 1 else "converged"

    assert carried_out(np.zeros(1), np.ones(1), 1.0, go) == "converged"
    assert went == [1.0, 0.5, 1.0]


def test_what_cannot_be_passed_is_said():
    assert carried_out(np.zeros(1), np.ones(1), 1.0, lambda u: "no" if u[0] > 0.3 else "converged") == (
        "no, at 30 % of the way"
    )


def test_each_actuator_has_its_own_longest_way():
    went = []
    carried_out(np.zeros(2), np.array([1.0, 100.0]), np.array([1.0, 50.0]), lambda u: went.append(u) or "converged")
    assert len(went) == 2


def test_a_long_command_is_halved_as_often_as_a_short_one():
    """Each of a hundred steps may be cut into eight, and what is left of a step is what is halved."""
    went = []

    def go(u):
        step = u[0] - (went[-1] if went else 0.0)
        if step > 1 / 8 + 1e-6 and u[0] > 50.0:
            return "no"
        went.append(u[0])
        return "converged"

    assert carried_out(np.zeros(1), np.array([100.0]), 1.0, go) == "converged"
    assert len(went) >= 50 + 8 * 49
