"""The cases themselves."""

from collections import Counter

import numpy as np
import pytest

from cfem.mechanics.mesh import Mesh
from cfem.robot.spec import SceneSpec
from cfem.stability.bodies import BAR, box, in_element
from cfem.stability.families import built_in, scene
from cfem.stability.suite import chosen, run

CASES = {case.name: case for case in built_in()}
FEW = [
    "incompressible/tet10p0/neo-hookean/0.4999",
    "moduli/1 kPa/force",
    "contrast/insert/1e+06/tet10p0",
    "contrast/rigid-phalanges/tet10/displacement",
    "slivers/1e+06/tet10p0/force",
    "slivers/plate 100:1/hex8/force",
    "cables/slack/one of two",
    "cables/two alike, forces",
    "cables/coincident points",
    "chambers/working pressure/hex8",
    "buckling/arch/hex8/past its limit load",
    "buckling/column/tet10p0/1.2 of Euler's load",
    "loads/weight 1 N/rigid end",
    "effectors/in the held region",
    "one element/tet4/force",
    "faults/inverted cell/hex8",
    "faults/open cavity/tet10",
    "not finite/displacement NaN",
    "programs/well posed/active_set",
    "programs/bounds of the box that exclude each other/osqp",
]


def test_there_are_enough_and_their_names_differ():
    assert len(CASES) >= 150
    assert Counter(case.name for case in built_in()).most_common(1)[0][1] == 1
    assert [case.name for case in chosen(built_in(), heavy=True) if case.heavy] == ["large/1e5 linear tetrahedra"]
    assert chosen(built_in(), "large/*") == []


def test_every_expectation_says_something():
    for case in CASES.values():
        assert bool(case.expect.statuses) != (case.expect.error is not None) and str(case.expect)
        assert not case.expect.statuses & {"TOO_MANY_ITERATIONS", "STEP_TOO_SMALL", "INACCURATE"}, case.name
        assert case.expect.error is None or case.expect.word


@pytest.mark.parametrize("name", FEW)
def test_a_few_of_each_family(name):
    assert run(CASES[name]).wrong == ()


@pytest.mark.slow
@pytest.mark.parametrize("name", [case.name for case in chosen(built_in())])
def test_every_case(name):
    assert run(CASES[name]).wrong == ()


@pytest.mark.parametrize("element, volume", [("tet4", 1 / 6), ("tet10", 1 / 6), ("hex8", 1)])
def test_boxes_are_whole_and_conform(element, volume):
    mesh = box((6.0, 4.0, 2.0), (3, 2, 2), element)
    assert mesh.volumes.sum() == pytest.approx(48.0) and (mesh.volumes > 0).all()
    np.testing.assert_allclose(mesh.volumes, volume * 4.0, rtol=1e-12)
    assert len(mesh.facets) == (32 if element == "hex8" else 64)
    hollow = box((6.0, 4.0, 2.0), (3, 2, 2), element, keep=lambda c: c[:, 0] < 3)
    assert hollow.volumes.sum() == pytest.approx(16.0) and len(np.unique(hollow.cells)) == len(hollow.X)


def test_elements_are_exchanged_with_their_sets():
    linear = box((6.0, 4.0, 2.0), (3, 2, 2), "tet4")
    end = {"end": np.flatnonzero(linear.X[:, 0] == 6.0)}
    linear = Mesh(linear.X, linear.cells, linear.facets, node_sets=end)
    quadratic = in_element(linear, "tet10p0")
    np.testing.assert_array_equal(quadratic.node_sets["end"], np.flatnonzero(quadratic.X[:, 0] == 6.0))
    back = in_element(quadratic, "tet4")
    for name in ("X", "cells", "facets"):
        np.testing.assert_array_equal(getattr(back, name), getattr(linear, name))
    np.testing.assert_array_equal(back.node_sets["end"], end["end"])
    assert in_element(linear, "tet4") is linear


SCENE = {
    "name": "bar",
    "out": "mesh",
    "length": "60 mm",
    "geometry": {"kind": "bar"},
    "mesh": {"size": "10 mm"},
    "material": {"young": "1 MPa", "poisson": 0.45},
    "fixed": [{"kind": "plane", "point": {"mm": [0, 0, 0]}, "normal": [-1, 0, 0]}],
    "actuators": [
        {
            "kind": "cable",
            "name": "cable",
            "pull_point": {"mm": [0, 5, 1]},
            "points": {"mm": [[15, 5, 1], [55, 5, 1]]},
            "reach": {"mm": [0, 8]},
        }
    ],
    "effectors": [{"name": "tip", "point": {"mm": [59, 5, 5]}}],
}


def test_a_scene_has_cases_of_its_own():
    cases = {case.name: case for case in scene.cases(SceneSpec.model_validate(SCENE), box(BAR, (4, 1, 1), "tet10p0"))}
    assert len(cases) >= 35 and all(name.startswith("scene/") for name in cases) and not cases.keys() & CASES.keys()
    for name in (
        "as it is",
        "poisson 0.4999",
        "1000 times as stiff",
        "law ogden",
        "element tet4",
        "middle third 1e+06 times as stiff",
        "cable alone",
        "all slack",
        "weight of 1e-08 of its strength",
        "held by nothing",
        "inverted cell",
        "point outside the body",
        "force of NaN",
    ):
        assert run(cases[f"scene/{name}"]).wrong == (), name
