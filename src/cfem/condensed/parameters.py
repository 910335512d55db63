"""Design and material parameters p: what a family of robots differs in, and the coordinates in which it is smooth."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np

Coordinate = Literal["linear", "log", "log(1-2p)"]


@dataclass(frozen=True)
class Parameter:
    """One number that varies from robot to robot.

    key: where the scene has it ('material.poisson'); unit: of its numbers ('1', 'MPa', 'mm'); low, high: its range;
    reference: the scene's own value; coordinate: the function of it in which the robot's response is smooth (log(1-2p)
    for Poisson's ratio: the bulk modulus is about its exponential); exact: Young's modulus of a homogeneous robot that
    carries no load. Its effect is W ~ 1/E, lambda ~ E, with delta_free unchanged: never sampled, never learned."""

    name: str
    key: str
    unit: str
    low: float
    high: float
    reference: float
    coordinate: Coordinate = "linear"
    exact: bool = False

    @property
    def moves_body(self) -> bool:
        """Whether the body itself differs: its geometry, or its free form."""
        return self.key.startswith(("geometry", "shape"))


def coordinates(parameters: Sequence[Parameter], p: np.ndarray) -> np.ndarray:
    """(..., n_p) values of `parameters` -> (..., n_p) their coordinates."""
    p = np.asarray(p, float)
    return np.stack([_FORWARD[one.coordinate](p[..., i]) for i, one in enumerate(parameters)], axis=-1)


def values(parameters: Sequence[Parameter], q: np.ndarray) -> np.ndarray:
    """The inverse of `coordinates`."""
    return np.stack([_BACK[one.coordinate](q[..., i]) for i, one in enumerate(parameters)], axis=-1)


def slopes(parameters: Sequence[Parameter], p: np.ndarray) -> np.ndarray:
    """(..., n_p) d coordinate / d p."""
    p = np.asarray(p, float)
    return np.stack([_SLOPE[one.coordinate](p[..., i]) for i, one in enumerate(parameters)], axis=-1)


def shares(parameters: Sequence[Parameter], p: np.ndarray) -> np.ndarray:
    """(..., n_p) values -> (..., n_p) in [0, 1]: place of their coordinates between those of the ends of the range."""
    if not parameters:
        return np.asarray(p, float)[..., :0]
    low, high = ends(parameters)
    return (coordinates(parameters, p) - low) / (high - low)


def from_shares(parameters: Sequence[Parameter], z: np.ndarray) -> np.ndarray:
    """The inverse of `shares`."""
    if not parameters:
        return np.asarray(z, float)[..., :0]
    low, high = ends(parameters)
    return values(parameters, low + z * (high - low))


def ends(parameters: Sequence[Parameter]) -> tuple[np.ndarray, np.ndarray]:
    """(n_p,) coordinates of the lower and of the higher end of each range."""
    return tuple(
        coordinates(parameters, np.array([getattr(one, end) for one in parameters])) for end in ("low", "high")
    )


def to_json(parameters: Sequence[Parameter]) -> list[dict[str, Any]]:
    return [asdict(one) for one in parameters]


def from_json(data: Sequence[dict[str, Any]]) -> tuple[Parameter, ...]:
    return tuple(Parameter(**one) for one in data)


def sampled(parameters: Sequence[Parameter]) -> tuple[Parameter, ...]:
    """Those that a dataset has columns for."""
    return tuple(one for one in parameters if not one.exact)


_FORWARD = {"linear": lambda p: p, "log": np.log, "log(1-2p)": lambda p: np.log1p(-2 * p)}
_BACK = {"linear": lambda q: q, "log": np.exp, "log(1-2p)": lambda q: -np.expm1(q) / 2}
_SLOPE = {"linear": np.ones_like, "log": lambda p: 1 / p, "log(1-2p)": lambda p: -2 / (1 - 2 * p)}
