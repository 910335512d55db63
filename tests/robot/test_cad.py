"""Geometry against volumes known without the mesher."""

import numpy as np
import pytest

from cfem.robot.cad import Box, Difference, Frustum, Loft, Prism, Union
from cfem.robot.catalogue.bar import Bar, bar
from cfem.robot.catalogue.soft_finger import SoftFinger, cavity, soft_finger
from cfem.robot.geometry import Refinement
from cfem.robot.mesh.meshing import run_gmsh
from cfem.robot.spec import Meshing

FINGER = SoftFinger(kind="soft-finger")
COARSE = Meshing.model_construct(size=10.0, refine=[], element="tet4")


def slices_volume(samples: int) -> float:
    """Volume of the finger by midpoint sums over x and z of its extent in y: nothing shared with the CAD tree."""
    x = (np.arange(samples) + 0.5) / samples * 36 - 18
    total = 0.0
    for z in (np.arange(samples) + 0.5) / samples * 120 - 120:
        depth = -z % 40
        y = np.where(abs(x) <= 8.75, min(20, 6 + depth, 46 - depth), 0.0)
        y = np.where((abs(x) <= 8.75) & (z > -20), np.maximum(y, 20), y)
        y = np.where((abs(x) <= 11.75) & (z > -3), 23.0, y)
        hollow = np.zeros_like(x)
        for joint in (-40, -80):
            if abs(z - joint) < 4:
                radius = 14.75 - 1.5 * abs(z - joint)
                y = np.maximum(y, np.sqrt(np.maximum(radius**2 - x**2, 0)))
                inner = np.sqrt(np.maximum((radius - 3.5) ** 2 - x**2, 0)) - 4
                hollow += np.where(abs(x) > 1.5, np.maximum(inner, 0), 0)
        total += (y - hollow).sum()
    return total * 36 * 120 / samples**2


def test_volume_of_the_finger_against_a_sum_over_slices():
    volume = run_gmsh(soft_finger(FINGER), COARSE)[2]
    assert volume == pytest.approx(slices_volume(2880), rel=1e-5)


def test_volume_of_a_cavity():
    """Two chambers of 143.475 mm^3 a joint."""
    bridge = Box((-2.0, 5.0, -41.0), (2.0, 6.0, -39.0))  # makes one body of the two: 3 x 1 x 2 mm between the walls
    volume = run_gmsh(Union((cavity(FINGER, -40.0), bridge)), COARSE)[2]
    assert volume == pytest.approx(2 * 143.475 + 6.0, rel=1e-4)


@pytest.mark.parametrize(
    "solid, volume",
    [
        (bar(Bar(kind="bar")), 6000.0),
        (Prism(((0.0, 0.0), (4.0, 0.0), (0.0, 3.0)), -1.0, 1.0), 12.0),
        (Frustum((0.0, 0.0, 0.0), (0.0, 0.0, 6.0), 2.0, 1.0), np.pi * 6 / 3 * (4 + 2 + 1)),
        (Loft(((0, 0, 0), (4, 0, 0), (0, 4, 0)), ((1, 1, 6), (3, 1, 6), (1, 3, 6))), 6 / 3 * (8 + 4 + 2)),
        (Difference(Box((0.0, 0.0, 0.0), (4.0, 4.0, 4.0)), (Box((1.0, 1.0, 1.0), (3.0, 3.0, 3.0)),)), 56.0),
        (Union((Box((0.0, 0.0, 0.0), (2.0, 2.0, 2.0)), Box((1.0, 0.0, 0.0), (3.0, 2.0, 2.0)))), 12.0),
    ],
)
def test_primitives_and_booleans(solid, volume):
    assert run_gmsh(solid, COARSE.model_copy(update={"size": 2.0}))[2] == pytest.approx(volume, rel=1e-6)


@pytest.mark.usefixtures("anew")
def test_the_same_job_gives_the_same_mesh_and_refinement_refines():
    first, second = (run_gmsh(soft_finger(FINGER), COARSE) for _ in range(2))
    np.testing.assert_array_equal(first[0], second[0])
    np.testing.assert_array_equal(first[1], second[1])
    box = Refinement(corners={"mm": [[-15, 0, -44], [15, 15, -36]]}, size="3 mm")
    finer = run_gmsh(soft_finger(FINGER), Meshing.model_construct(size=10.0, refine=[box], element="tet4"))
    assert len(finer[1]) > len(first[1])
