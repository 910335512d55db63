"""Combined states against a bar bent to arcs of circles, in closed form, and against differences."""

from dataclasses import replace

import numpy as np
import pytest
from support.blocks import block, box

from cfem.equilibrium.system.rotation_strain import make_rotation_strain
from cfem.mechanics.body import make_body
from cfem.mechanics.element import ELEMENTS
from cfem.mechanics.material import LAWS
from cfem.mechanics.material.law import Material
from cfem.mechanics.mesh import Mesh

SIZE = np.array([20.0, 2.0, 2.0])
every_element = pytest.mark.parametrize("element", ["tet4", "tet10", "tet10p0", "hex8"])


def bar(element, divisions=(20, 2, 2)):
    mesh = box(SIZE, divisions, element)
    body = make_body(mesh, ELEMENTS[element], Material(LAWS["neo-hookean"], 1.0, 0.3))
    return mesh.X, make_rotation_strain(body, np.flatnonzero(mesh.X[:, 0] < 1e-9))


def arc(X, angle):
    """Places of a bar along x whose end has turned by an angle (rad): stretch and rotation vector are linear in it."""
    if angle == 0:
        return X.copy()
    radius, turned = SIZE[0] / angle, angle * X[:, 0] / SIZE[0]
    distance = radius - X[:, 2]
    return np.column_stack([distance * np.sin(turned), X[:, 1], radius - distance * np.cos(turned)])


def slope(X, angle, step=1e-5):
    return (arc(X, angle + step) - arc(X, angle - step)) / (2 * step)


@every_element
def test_a_tangent_leads_along_the_arc_and_positions_leave_it(element):
    X, shape = bar(element)
    for start, angle in ((0.0, 1.5), (1.0, 2.5), (2.0, 0.0)):
        there, motion = arc(X, start), (angle - start) * slope(X, start)
        led = shape.combined(there[None], motion[None], np.ones(1))
        error, straight = (np.abs(x - arc(X, angle)).max() for x in (led, there + motion))
        assert error < straight / 20, (start, error, straight)


def test_what_is_left_of_the_arc_falls_with_the_mesh():
    errors = []
    for count in (10, 20):
        X, shape = bar("tet10", (count, 2, 2))
        errors.append(np.abs(shape.combined(X[None], 2.0 * slope(X, 0.0)[None], np.ones(1)) - arc(X, 2.0)).max())
    assert errors[1] < errors[0] / 3.5  # second order at least


def test_states_of_an_arc_are_interpolated_along_it():
    X, shape = bar("tet10")
    states = np.stack([arc(X, angle) for angle in (0.4, 1.4)])
    middle = shape.combined(states, np.zeros_like(states), np.array([0.5, 0.5]))
    assert np.abs(middle - arc(X, 0.9)).max() < 0.05 * np.abs(states.mean(axis=0) - arc(X, 0.9)).max()


@every_element
def test_a_state_is_itself(element):
    X, shape = bar(element, (6, 2, 2))
    x = arc(X, 1.0) + 0.02 * np.random.default_rng(0).normal(size=X.shape) * ~shape.held[:, None]
    np.testing.assert_allclose(shape.combined(x[None], np.zeros((1, *x.shape)), np.ones(1)), x, atol=1e-12)


@every_element
def test_small_motions_are_the_tangent(element):
    X, shape = bar(element, (6, 2, 2))
    rng, free = np.random.default_rng(1), ~shape.held[:, None]
    states = np.stack([arc(X, 1.0) + 0.02 * rng.normal(size=X.shape) * free for _ in range(2)])
    motions = rng.normal(size=states.shape) * free

    def combined(size, weights):
        return shape.combined(states[: len(weights)], size * motions[: len(weights)], np.array(weights))

    errors = [np.abs(combined(h, [1.0]) - states[0] - h * motions[0]).max() for h in (1e-2, 1e-3)]
    assert errors[1] < errors[0] / 90
    # of a second state: by differences of a state moved by as much, relative to the first
    moved = np.stack([states[0], states[1] + 1e-5 * motions[1]])
    apart = shape.combined(moved, np.zeros_like(moved), np.array([0.3, 0.7]))
    motion = np.stack([np.zeros_like(X), 0.7e-5 * motions[1]])
    np.testing.assert_allclose(apart, shape.combined(states, motion, np.array([0.3, 0.7])), atol=1e-8)


def test_states_that_turn_too_far_from_each_other_are_not_combined():
    X, shape = bar("tet10")
    states = np.stack([arc(X, 0.0), arc(X, 3.0)])
    assert shape.combined(states, np.zeros_like(states), np.array([0.5, 0.5])) is None
    assert shape.combined(states[1:], np.zeros_like(states[1:]), np.ones(1)) is not None


def test_a_piece_that_nothing_holds_has_no_such_coordinates():
    mesh = block((1, 1, 1), (1, 1, 1))
    both = Mesh(
        np.concatenate([mesh.X, mesh.X + 3]),
        np.concatenate([mesh.cells, mesh.cells + len(mesh.X)]),
        np.concatenate([mesh.facets, mesh.facets + len(mesh.X)]),
    )
    body = make_body(both, ELEMENTS["tet4"], Material(LAWS["neo-hookean"], 1.0, 0.3))
    assert make_rotation_strain(body, np.arange(4)) is None
    assert make_rotation_strain(body, np.array([0, len(mesh.X)])) is not None
    assert make_rotation_strain(replace(body, solids=()), np.arange(4)) is None
