"""Schemas of the rows of W and of parameters in files: see `Rows` and `Parameter`."""

from typing import Literal

from pydantic import Field

from cfem.condensed.parameters import Coordinate
from cfem.core.names import Name
from cfem.core.reading import Data

Units = tuple[Literal["mm", "mm^3", "rad"], Literal["N", "MPa", "N mm"]]  # of a row's displacement and multiplier
Pair = tuple[float, float]
MOST = 1000  # names


class RowsCard(Data, extra="forbid"):
    """Names of the rows of W."""

    effectors: list[Name] = Field(min_length=1, max_length=MOST)
    actuators: list[Name] = Field(min_length=1, max_length=MOST)
    contacts: list[Name] = Field([], max_length=MOST)
    skin: list[Name] = Field([], max_length=MOST)

    def check(self) -> None:
        names, watched = [*self.actuators, *self.contacts], [*self.effectors, *self.skin]
        if len(set(watched)) < len(watched) or len(set(names)) < len(names):
            raise ValueError("two rows have the same name")


class ParameterCard(Data, extra="forbid"):
    """A parameter, its range within the values that its coordinate has a number for."""

    name: Name
    key: str
    unit: Literal["1", "mm", "N", "MPa", "rad", "mm^3", "mm/s^2", "t/mm^3"]
    low: float
    high: float
    reference: float
    coordinate: Coordinate
    exact: bool

    def check(self) -> None:
        if not self.low < self.high:
            raise ValueError("low is not below high")
        least = 0.0 if self.exact or self.coordinate == "log" else -float("inf")
        most = 0.5 if self.coordinate == "log(1-2p)" else float("inf")
        if not all(least < value < most for value in (self.low, self.high, self.reference)):
            raise ValueError(f"its values must lie between {least:g} and {most:g}")
