"""Loads of an export that it refuses (what it takes: control/test_loads)."""

import pytest
from predict.rows import chain

from cfem.core.errors import InputError
from cfem.export.loads import solves_patches, under_loads
from cfem.export.spec import ExportSpec

PUSH = {"at": {"mm": [0, 0, 40]}, "radius": "5 mm", "force": {"N": [0, 0.01, 0]}}


def asked(**more):
    return ExportSpec.model_validate({"model": "row", "out": "out", "loads": {"push": PUSH}, **more})


def test_modules_in_a_row_have_no_export_under_a_force_on_a_patch(tmp_path):
    row = chain()
    with pytest.raises(InputError, match=r"loads.push: modules in a row have no export .*state it in control.yaml"):
        under_loads(asked(), row.meta, row.arrays, {}, tmp_path, None)


def test_finite_elements_are_asked_where_there_is_a_scene_and_a_patch():
    tip = {"tip": {"force": {"N": [0, 0.01, 0]}}}
    assert solves_patches(asked(scene="scene.yaml"))
    assert not solves_patches(asked()) and not solves_patches(asked(scene="scene.yaml", loads=tip))
