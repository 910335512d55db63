"""`material: {name: ecoflex-00-30}`: a name stands for the constants of a law."""

import difflib
from typing import Any

from pydantic import Field, GetJsonSchemaHandler

from cfem.core.spec import Spec, described
from cfem.core.units import Density


class ByName(Spec):
    """An elastomer by name. `cfem material show NAME` prints its constants, their range and their source."""

    name: str
    """Name of the elastomer, as `cfem material list` has it."""
    stiffness: float = Field(default=1.0, gt=0)
    """Factor on all moduli: what a calibration finds where the batch is stiffer or softer than the constants."""
    poisson: float = Field(default=0.499, ge=0, lt=0.5)
    """Poisson's ratio, from 0 to 0.4999."""
    density: Density | None = Field(default=None, gt=0)
    """Density, the maker's unless given."""


def constants_of(data: dict[str, Any]) -> dict[str, Any]:
    """Constants of a material that a scene gives by name. ValueError where no elastomer has that name, or where a key
    beside it does not go with a name."""
    from cfem.robot.elastomers import ELASTOMERS, POISSON

    name = data["name"]
    if not isinstance(name, str) or name not in ELASTOMERS:
        near = difflib.get_close_matches(str(name), ELASTOMERS, n=1, cutoff=0.5)
        hint = f"did you mean '{near[0]}'?" if near else "`cfem material list` shows all"
        raise ValueError(f"no elastomer is called '{name}' ({hint})")
    strange = [key for key in data if key not in ByName.model_fields]
    if strange:
        allowed = ", ".join(key for key in ByName.model_fields if key != "name")
        raise ValueError(f"'{strange[0]}' does not go with a name, which takes {allowed}")
    elastomer = ELASTOMERS[name]
    given = {key: value for key, value in data.items() if key != "name" and value is not None}
    return {"poisson": POISSON, "density": elastomer.density, **elastomer.constants, **given}


class NameAllowed:
    """Marks an annotation whose JSON Schema takes a name as well."""

    def __get_pydantic_json_schema__(self, core: Any, handler: GetJsonSchemaHandler) -> dict:
        from cfem.robot.elastomers import ELASTOMERS

        named = handler(ByName.__pydantic_core_schema__)
        for key, text in described(ByName).items():
            named["properties"][key]["description"] = text
        named["properties"]["name"]["enum"] = list(ELASTOMERS)
        return {"anyOf": [handler(core), named]}
