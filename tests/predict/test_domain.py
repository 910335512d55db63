"""The domain is what the training states fill, in displacements and in multipliers."""

import json

import numpy as np
from surrogate.synthetic import dataset, energy

from cfem.predict.domain import Domain


def test_it_holds_its_states_and_survives_json():
    states = dataset(100, 1)
    domain = Domain.from_json(json.loads(json.dumps(Domain.of(states.delta_a, states.lambda_a).to_json())))
    assert all(map(domain.holds, states.delta_a, states.lambda_a))


def test_it_refuses_a_pushing_cable_and_one_pulled_too_far():
    states = dataset(400, 1)
    domain = Domain.of(states.delta_a, states.lambda_a)
    for delta_a in ([15.0, 2.0], [23.0, 23.0], [-3.0, -3.0]):
        state = np.array(delta_a)
        assert not domain.holds(state, energy(state[None])[1][0])


def test_how_far_outside_is_a_share_of_the_range():
    states = np.random.default_rng(0).uniform(0, 10, (300, 2))
    domain = Domain.of(states, states)
    assert domain.outside(np.array([5.0, 5.0]), np.array([5.0, 5.0])) == 0.0
    width = domain.delta_a[1, 0] - domain.delta_a[0, 0]
    beyond = np.array([domain.delta_a[1, 0] + 0.3 * width, 5.0])
    assert np.isclose(domain.outside(beyond, np.array([5.0, 5.0])), 0.3)


def test_distance_finds_a_hole_in_the_data():
    states = np.random.default_rng(0).uniform(-1, 1, (400, 2))
    ring = states[np.linalg.norm(states, axis=1) > 0.6]
    domain, hole = Domain.of(ring, ring), np.zeros(2)
    assert domain.outside(hole, hole) == 0.0
    assert domain.distance(hole, hole) > 2 and not domain.holds(hole, hole)
    assert max(domain.distance(state, state) for state in ring) <= 1.0


def test_one_state_is_a_domain():
    domain = Domain.of(np.array([[1.0, 2.0]]), np.array([[3.0, 4.0]]))
    assert domain.holds(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
