"""Chambers along a rod: their growth against the volume of a closed surface swept by the same sections."""

import numpy as np
from scipy.spatial.transform import Rotation
from support.rods import rod_body

from cfem.constraint.cavity import make_cavity
from cfem.constraint.rod_chambers import make_rod_chambers
from cfem.mechanics.rod.element import screw

CENTRE, HALF = np.array([3.0, -1.5]), 0.4
STRAIN = np.array([0.08, 0.02, -0.03, 0.01, -0.02, 0.015])  # gamma, kappa (1/mm)


def bent(elements):
    """A rod under one strain all along, and its frames."""
    body = rod_body(elements)
    h = body.sections.spacing
    p, turns = screw(h[:, None] * STRAIN, h)
    c, R = np.zeros((elements + 1, 3)), np.tile(np.eye(3), (elements + 1, 1, 1))
    for k in range(elements):
        c[k + 1], R[k + 1] = c[k] + R[k] @ p[k], R[k] @ turns[k]
    x = body.mesh.X.copy()
    x[body.sections.nodes] = c[:, None] + body.sections.arm @ R.swapaxes(1, 2)
    return body, x, c, R


def swept(c, R):
    """mm^3 between squares around CENTRE in each section, their walls bilinear, less the volume at rest."""
    square = np.column_stack([np.zeros(4), CENTRE + HALF * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])])
    points = (c[:, None] + square @ R.swapaxes(1, 2)).reshape(-1, 3)
    a = 4 * np.arange(len(c) - 1)[:, None] + np.arange(4)
    b = 4 * np.arange(len(c) - 1)[:, None] + np.roll(np.arange(4), -1)
    walls = np.stack([a, b, b + 4, a + 4], axis=-1).reshape(-1, 4)
    lids = [[3, 2, 1, 0], (4 * (len(c) - 1) + np.arange(4)).tolist()]
    return make_cavity(points, np.concatenate([walls, lids]), "swept").rest_volume - 100.0 * (2 * HALF) ** 2


def test_growth_is_the_volume_that_the_section_sweeps():
    errors = []
    for elements in (80, 160):
        body, x, c, R = bent(elements)
        chamber = make_rod_chambers(body.rod, CENTRE[None], (2 * HALF) ** 2, np.arange(elements))
        errors.append(abs(chamber.value(x)[0] - swept(c, R)))
    assert errors[1] < 1e-3 * abs(swept(c, R))
    assert errors[0] / errors[1] > 3.5  # the bilinear walls' error, of second order


def test_growth_is_that_of_the_centre_line_and_of_its_elements_alone():
    body, x, _, _ = bent(10)
    first = make_rod_chambers(body.rod, CENTRE[None], 2.0, np.arange(5))
    both = make_rod_chambers(body.rod, np.array([CENTRE, -CENTRE]), 2.0, np.arange(10))
    gamma, ky, kz = STRAIN[0], STRAIN[4], STRAIN[5]
    np.testing.assert_allclose(first.value(x), 50.0 * 2.0 * (gamma + ky * CENTRE[1] - kz * CENTRE[0]), rtol=1e-9)
    np.testing.assert_allclose(both.value(x), 2 * 100.0 * 2.0 * gamma, rtol=1e-9)
    turned = Rotation.from_rotvec([0.3, 1.0, -2.0]).apply(x) + 5.0
    np.testing.assert_allclose(first.value(turned), first.value(x), rtol=1e-9)
