"""The columns of a table of measured numbers that an actuator may have, and their units."""

from collections.abc import Sequence
from typing import Literal

from cfem.dataset.tables import Units

Driven = Literal["displacement", "force"]
DUAL: dict[str, Driven] = {"displacement": "force", "force": "displacement"}


def actuator_columns(
    actuators: Sequence[str], units: Sequence[tuple[str, str]], command: Driven | None = None
) -> Units:
    """Unit of each column, `NAME.displacement`, `NAME.force` and, where commands were recorded, `NAME.command`.

    units:   of each actuator's displacement and force
    command: what commands state"""
    columns = {}
    for name, pair in zip(actuators, units, strict=True):
        unit = dict(zip(("displacement", "force"), pair, strict=True))
        columns |= {f"{name}.{quantity}": unit[quantity] for quantity in unit}
        if command is not None:
            columns[f"{name}.command"] = unit[command]
    return columns
