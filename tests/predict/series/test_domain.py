"""The domain is what the training states fill, in displacements and in multipliers."""

import json

import numpy as np
from surrogate.synthetic import dataset, energy

from cfem.predict.series.domain import Domain


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


def test_its_states_begin_in_the_middle():
    """In the units of the boxes; `cfem.condensed.spread` has the order of the others."""
    rng = np.random.default_rng(4)
    delta_a, lambda_a = rng.normal(size=(60, 2)), 1e-3 * rng.normal(size=(60, 1))
    domain, states = Domain.of(delta_a, lambda_a), np.hstack([delta_a, lambda_a])
    width = np.ptp(np.hstack([domain.delta_a, domain.lambda_a]), axis=0)
    apart = np.linalg.norm((states - states.mean(axis=0)) / width, axis=1)
    np.testing.assert_array_equal(domain.states[0], states[apart.argmin()])
    assert len(np.unique(domain.states, axis=0)) == 60


def test_boxes_distances_and_neighbours_are_those_of_brute_force():
    rng = np.random.default_rng(5)
    delta_a, lambda_a, p = rng.uniform(-1, 3, (40, 2)), rng.normal(size=(40, 2)), rng.uniform(size=(40, 1))
    domain = Domain.of(delta_a, lambda_a, p)
    size = np.ptp(delta_a, axis=0)
    np.testing.assert_allclose(domain.delta_a, [delta_a.min(axis=0) - 0.05 * size, delta_a.max(axis=0) + 0.05 * size])
    known = np.hstack([delta_a, lambda_a, p])
    width = 1.1 * np.ptp(known, axis=0)
    apart = np.linalg.norm((known[:, None] - known) / width, axis=2)
    gap = np.sort(apart, axis=1)[:, 1].max()
    asked = rng.normal(size=(7, 5))
    nearest = np.linalg.norm((asked[:, None] - known) / width, axis=2).min(axis=1)
    np.testing.assert_allclose(domain.distance(asked[:, :2], asked[:, 2:4], asked[:, 4:]), nearest / gap)
    for s, q in zip(asked[:, :2], asked[:, 4:], strict=True):
        for form, mine, other in (("displacement", delta_a, lambda_a), ("force", lambda_a, delta_a)):
            unit, shift = 1.1 * np.ptp(mine, axis=0), 1.1 * np.ptp(p, axis=0)
            far = (((mine - s) / unit) ** 2).sum(axis=1)
            assert np.array_equal(domain.nearest(s, form), other[np.argmin(far)])
            assert np.array_equal(domain.nearest(s, form, q), other[np.argmin(far + (((p - q) / shift) ** 2)[:, 0])])


def test_a_state_without_spread_has_a_unit_of_one():
    domain = Domain.of(np.full((3, 1), 2.0), np.array([[0.0], [1.0], [2.0]]))
    assert domain.outside(np.array([2.0]), np.array([1.0])) == 0.0
    assert domain.outside(np.array([2.5]), np.array([1.0])) == 0.5


def test_a_state_beside_a_thin_sheet_of_states_is_not_among_them():
    """Three cables that move with two bends: a third direction, in which they differ by a hundredth, is part of the
    body's stretch, and a state half as far along it as along the others lies within both boxes all the same."""
    rng = np.random.default_rng(3)
    angles = np.radians([0.0, 120.0, 240.0])
    bends = np.column_stack([np.cos(angles), np.sin(angles)])
    delta_a = rng.uniform(-1, 1, (60, 2)) @ bends.T + 0.01 * rng.uniform(-1, 1, (60, 1))
    lambda_a = rng.uniform(0, 1, (60, 3))
    domain = Domain.of(delta_a, lambda_a)
    middle, among = np.full(3, 0.5), delta_a.mean(axis=0)
    beside = among + 0.05
    assert domain.outside(beside, middle) == 0.0 and domain.distance(beside, middle) < 2
    assert domain.holds(among, middle) and not domain.holds(beside, middle)
    assert domain.holds(delta_a[:4], np.tile(middle, (4, 1))).all()
