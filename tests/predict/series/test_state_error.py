"""Sizes to which errors are relative."""

from types import SimpleNamespace

import numpy as np

from cfem.predict.series.state_error import entry_sizes, reaction_sizes

DOMAIN = SimpleNamespace(delta_a=np.array([[1.0, -6.0], [-4.0, 2.0]]), lambda_a=np.array([[0.5, 3.0], [-2.0, 1.0]]))
# twice and half as soft as the robot of the training states
MODEL = SimpleNamespace(domain=DOMAIN, softness=lambda p: np.array([[2.0], [0.5]]))


def test_a_softer_robot_is_held_by_smaller_forces_and_moves_as_far():
    np.testing.assert_allclose(reaction_sizes(MODEL, "displacement"), [[1.0, 1.5], [4.0, 6.0]])
    np.testing.assert_allclose(reaction_sizes(MODEL, "force"), [4.0, 6.0])


def test_entries_of_a_compliance_are_measured_by_its_diagonal():
    np.testing.assert_allclose(entry_sizes(np.array([[4.0, 1.0], [1.0, 9.0]])), [[4.0, 6.0], [6.0, 9.0]])
