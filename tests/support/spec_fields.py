"""What fields of a spec may be, and are where nothing is stated."""

from typing import Annotated

import pytest
from pydantic import Field, TypeAdapter, ValidationError


def demand_field(spec, name, least, refused, *unstated):
    """The field `name` of a spec takes the value `least`, the last that it may, and not `refused`; unstated: what it is
    where nothing is stated, none for a field that has to be."""
    info = spec.model_fields[name]
    adapter = TypeAdapter(Annotated[info.annotation, *info.metadata, Field()])
    adapter.validate_python(least)
    with pytest.raises(ValidationError):
        adapter.validate_python(refused)
    assert info.is_required() == (not unstated)
    if unstated:
        assert info.get_default(call_default_factory=True) == unstated[0]
