"""Loads of an export: what it asks of finite elements (what it takes: control/test_loads, surrogate/test_serial)."""

from cfem.export.loads import solves_patches
from cfem.export.spec import ExportSpec

PUSH = {"at": {"mm": [0, 0, 40]}, "radius": "5 mm", "force": {"N": [0, 0.01, 0]}}


def asked(**more):
    return ExportSpec.model_validate({"model": "row", "out": "out", "loads": {"push": PUSH}, **more})


def test_finite_elements_are_asked_where_there_is_a_scene_and_a_patch():
    tip = {"tip": {"force": {"N": [0, 0.01, 0]}}}
    assert solves_patches(asked(scene="scene.yaml"))
    assert not solves_patches(asked()) and not solves_patches(asked(scene="scene.yaml", loads=tip))
