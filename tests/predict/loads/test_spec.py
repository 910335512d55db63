"""What a spec of a load may say, and says where it is silent."""

import pytest
from support.spec_fields import demand_field

from cfem.predict.loads.spec import LoadSpec


@pytest.mark.parametrize(
    ("spec", "name", "least", "refused", "unstated"),
    [
        (LoadSpec, "radius", "1 um", "0 mm", [None]),
        (LoadSpec, "mass", "1 mg", "0 g", [None]),
    ],
)
def test_what_a_load_may_be(spec, name, least, refused, unstated):
    demand_field(spec, name, least, refused, *unstated)
