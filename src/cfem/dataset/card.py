"""Schema of a dataset's metadata, checked before its rows are read; `schema.py` writes it."""

from typing import Any

from pydantic import Field

from cfem.condensed.card import Pair, ParameterCard, RowsCard, Units
from cfem.core.names import Name
from cfem.core.reading import Data


class ViscosityCard(Data):
    """Viscosity of a material, as a file has it."""

    relaxation: float = Field(ge=0)  # s
    prony: list[tuple[float, float]] = Field(max_length=100)  # (share, s) of each term


class DatasetCard(Data):
    """Metadata of a dataset.

    robot: what the scene said of it
    plan: what sample.yaml says of the draws
    compliance: at rest, of all rows that carry a multiplier
    skin: SHA-256 of the file of its modes
    viscosity: of each viscous material, where the rows can move
    inner: the number of inner motions"""

    scene: Name
    robot: dict[str, Any] | None = None
    rows: RowsCard
    row_units: list[Units]
    units: dict[str, str | list[str]]
    parameters: list[ParameterCard] = Field(max_length=100)
    rest_e: list[float]
    reach: list[Pair]
    length: float = Field(gt=0)
    plan: dict[str, Any] = {}
    compliance: list[list[float]] | None = None
    skin: str | None = None
    viscosity: list[ViscosityCard] | None = Field(None, max_length=1000)
    inner: int = Field(0, ge=0, le=1000)

    def check(self) -> None:
        """Checks that numbers of entries fit the rows."""
        rows = self.rows
        n_e, n_a, n_c = len(rows.effectors), len(rows.actuators), len(rows.contacts)
        if bool(rows.skin) != (self.skin is not None):
            raise ValueError("skin: the rows of a skin need its file's SHA-256")
        for what, count, expected in (
            ("row_units", len(self.row_units), n_e + len(rows.skin) + n_a + n_c),
            ("rest_e", len(self.rest_e), n_e),
            ("reach", len(self.reach), n_a),
            ("compliance", len(self.compliance or []), n_a + n_c if self.compliance else 0),
        ):
            if count != expected:
                raise ValueError(f"{what} has {count} entries for {expected} rows")
        if any(len(row) != n_a + n_c for row in self.compliance or []):
            raise ValueError("compliance is no square matrix")
        if any(not low < high for low, high in self.reach):
            raise ValueError("reach: the smaller number comes first")
        if n_c and (self.compliance is None or not isinstance(self.plan.get("contact"), dict)):
            raise ValueError("rows of a held patch need its plan and the compliance at rest")
