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
