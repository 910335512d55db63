"""A model at parameters of its own: those of a design, or those that a controller tracks."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from cfem.condensed import Condensed, Rows
from cfem.condensed.model import Form
from cfem.condensed.model_error import StateError
from cfem.predict.protocol import Predictor
from cfem.predict.series.domain import Domain


@dataclass
class AtParameters:
    """`Model`: a predictor at parameters p (n_p,), which may change while it is used."""

    predictor: Predictor
    p: np.ndarray

    @property
    def rows(self) -> Rows:
        return self.predictor.rows

    @property
    def form(self) -> Form:
        return self.predictor.form

    @property
    def meta(self) -> dict[str, Any]:
        return self.predictor.meta

    @property
    def domain(self) -> Domain:
        return self.predictor.domain

    def at_displacement(self, delta_a: np.ndarray) -> Condensed:
        return self.predictor.at_displacement(delta_a, self.p)

    def at_force(self, lambda_a: np.ndarray) -> Condensed:
        return self.predictor.at_force(lambda_a, self.p)

    def inside(self, condensed: Condensed) -> bool:
        return self.predictor.inside(condensed, self.p)

    def error(self, condensed: Condensed) -> StateError | None:
        return self.predictor.error(condensed, self.p)

    def distance(self, condensed: Condensed) -> float:
        return self.predictor.distance(condensed, self.p)
