"""Editors, and the reference pages, explain every key of every spec."""

import json

import pytest

from cfem.cli.schemas import schema_of
from cfem.core.kinds import KINDS


@pytest.mark.parametrize("name", KINDS)
def test_every_key_is_described_with_the_unit_of_its_default(name):
    schema = json.loads(schema_of(name))
    for part in (schema, *schema.get("definitions", {}).values()):
        assert part["description"], part
        for key, field in part.get("properties", {}).items():
            where = f"{part['title']}.{key}: {field}"
            assert field.get("description", "").endswith((".", ")")), where
            assert not (field.get("type") == "string" and isinstance(field.get("default"), float)), where
