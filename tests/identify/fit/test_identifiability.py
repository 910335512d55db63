"""What measurements cannot tell, on Jacobians whose null space is known."""

import numpy as np

from cfem.condensed.parameters import Parameter
from cfem.identify.fit.free_parameter import estimate, from_reference, share_of_range
from cfem.identify.fit.identifiability import prior_sentences, share_sentences, unseen
from cfem.identify.fit.uncertainty import information, uncertainty

E, NU = Parameter("E", "material.young", "MPa", 1.0, 3.0, 2.0), Parameter("nu", "material.poisson", "1", 0.3, 0.5, 0.4)


def test_a_parameter_that_moves_nothing_is_unseen():
    jacobian = np.array([[1.0, 0.0], [2.0, 1e-12]])
    assert unseen([jacobian], 1.0, [None]).tolist() == [False, True]
    assert unseen([jacobian, jacobian[:, ::-1]], 1.0, [None, None]).tolist() == [False, False]


def test_a_parameter_that_moves_less_than_the_model_is_wrong_is_unseen():
    jacobian = np.array([[1.0, 0.01], [2.0, 0.02]])
    assert unseen([jacobian], 1.0, [np.full(2, 0.03)]).tolist() == [False, True]
    assert unseen([jacobian], 1.0, [np.full(2, 0.003)]).tolist() == [False, False]


def test_parameters_of_which_some_act_as_one_are_not_called_identifiable():
    known = uncertainty(np.array([0.1, -0.1, 0.2]), np.outer([1.0, 2.0, 3.0], [1.0, 2.0]), True, 0.95)
    assert share_sentences([E, NU], known, np.zeros(2)) == []


def test_functions_of_what_is_measured_have_a_deviation_where_their_parts_have_none():
    known = information(np.array([[1.0, 1.0], [2.0, 2.0]]))
    assert known.rank == 1 and np.isinf(known.deviation(np.eye(2))).all()
    np.testing.assert_allclose(known.deviation(np.array([1.0, 1.0])), 1 / np.sqrt(5))


def test_unknowns_alike_unlearned_and_at_an_end_are_told():
    unknowns = [from_reference("E", E, 0.5), from_reference("nu", NU, 0.05)]
    covariance = np.array([[0.64, 0.76], [0.76, 1.0]])
    sentences = prior_sentences(unknowns, [True, False], np.array([2.0, 0.0]), covariance)
    assert [sentence.split(":")[0] for sentence in sentences] == [
        "E", "E lies at an end of its range", "E and nu cannot be told apart",
    ]  # fmt: skip


def test_an_estimate_stays_within_its_range_and_marks_its_end():
    near_end = estimate(share_of_range(E), 1.0, 0.1, 2.0, (0.7, None))
    assert (near_end.value, near_end.at_end) == (3.0, True)
    np.testing.assert_allclose(near_end.interval, (2.6, 3.0))
    assert near_end.profile == (2.4, None)
    assert estimate(share_of_range(E), 0.5, np.inf, 2.0).interval == (None, None)
