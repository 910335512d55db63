"""Points that rigid sections carry: they follow every motion of their sections, inside the outline or not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.rods import rod_body

from cfem.constraint.section_point import attach_to_sections, make_section_effector
from cfem.core.errors import SpecError

BODY = rod_body(4)  # sections at 0, 25, ..., 100 mm, 2 mm wide
X, SECTIONS = BODY.mesh.X, list(BODY.sections.nodes)


def moved(seed=0):
    """Every section turned and shifted on its own."""
    rng = np.random.default_rng(seed)
    x, motions = X.copy(), []
    for nodes in SECTIONS:
        turn, shift = Rotation.from_rotvec(rng.standard_normal(3)), rng.standard_normal(3)
        centre = X[nodes].mean(axis=0)
        x[nodes] = turn.apply(X[nodes] - centre) + centre + shift
        motions.append((turn, centre, shift))
    return x, motions


def test_a_point_in_a_section_moves_with_its_frame_however_far_out_it_lies():
    x, motions = moved()
    point = np.array([50.0, 7.0, -4.0])
    turn, centre, shift = motions[2]
    expected = turn.apply(point - centre) + centre + shift
    np.testing.assert_allclose(attach_to_sections(X, SECTIONS, point, "p").position(x), expected, atol=1e-12)


def test_sections_need_not_lie_about_the_axis():
    beside = X + [0.0, 3.0, -8.0]
    found = attach_to_sections(beside, SECTIONS, np.array([35.0, 4.0, -9.0]), "p")
    np.testing.assert_allclose(found.position(beside), [35.0, 4.0, -9.0], atol=1e-12)


def test_a_point_between_two_sections_lies_between_what_they_carry():
    x, _ = moved()
    ends = [attach_to_sections(X, SECTIONS, np.array([at, 0.5, 0.3]), "p").position(x) for at in (25.0, 50.0)]
    between = attach_to_sections(X, SECTIONS, np.array([35.0, 0.5, 0.3]), "p")
    np.testing.assert_allclose(between.position(x), 0.6 * ends[0] + 0.4 * ends[1], atol=1e-12)
    assert between.weights.sum() == pytest.approx(1.0)


def test_an_effector_with_orientation_is_the_frame_of_its_section():
    x, motions = moved()
    effector = make_section_effector(X, SECTIONS, np.array([100.0, 0.0, 0.0]), "tip", orientation=True)
    turn, centre, shift = motions[-1]
    np.testing.assert_allclose(effector.value(x), [*(centre + shift), *turn.as_rotvec()], atol=1e-12)
    d, h = np.random.default_rng(1).standard_normal(X.shape), 1e-6
    slope = (effector.value(x + h * d) - effector.value(x - h * d)) / (2 * h)
    np.testing.assert_allclose(np.einsum("rki,ki->r", effector.gradient(x), d[effector.nodes]), slope, atol=1e-7)


@pytest.mark.parametrize("at", [-1.0, 100.5])
def test_a_point_beyond_the_ends_is_named(at):
    with pytest.raises(SpecError, match="lies outside the sections, x from 0 to 100 mm"):
        attach_to_sections(X, SECTIONS, np.array([at, 0.0, 0.0]), "tip")
