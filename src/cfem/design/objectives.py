"""Objectives of a design: numbers, the smaller the better, of many condensed states at once.

Dexterity and strength after Navez, Menager et al. 2025: how far the tip bends from a right angle, and how far the force
that the tip, held where it rests, can give stays below one that is out of reach."""

import importlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from cfem.condensed import Rows
from cfem.core.errors import NumericalError, SpecError
from cfem.parametric.states import States

Objective = Callable[[States], np.ndarray]


def with_unit(objective: Objective, value: float) -> str:
    """Value for a person: as it was asked for, not its negative where more is better, and with its unit."""
    return f"{getattr(objective, 'sign', 1.0) * value:.5g} {getattr(objective, 'unit', '')}".rstrip()


@dataclass(frozen=True)
class Dexterity:
    """| angle - alpha |, alpha = arccos(tip_z / |rest|), of one effector; along: its row that is tip_z, counted in
    `rows` (3,), its x, y and z. rest: (3,) mm the same for all designs, or None: where each design rests."""

    rows: np.ndarray
    along: int
    angle: float
    rest: np.ndarray | None
    unit: ClassVar[str] = "rad"

    def __call__(self, states: States) -> np.ndarray:
        rest = states.rest_e[:, self.rows] if self.rest is None else self.rest
        cosine = states.x_e[:, self.rows[self.along]] / np.linalg.norm(rest, axis=-1)
        return np.abs(self.angle - np.arccos(np.clip(cosine, -1.0, 1.0)))


@dataclass(frozen=True)
class Strength:
    """| largest - |lambda_c| |, lambda_c the force (N) along `along` that holds the effector at its rest position while
    the actuators stand where they do:

    lambda_c = (W_ca W_aa^-1 W_ac - W_cc)^-1 (W_ca W_aa^-1 (delta_a - delta_free_a) + delta_free_c)"""

    rows: np.ndarray
    along: int
    largest: float
    rest: np.ndarray | None
    unit: ClassVar[str] = "N"
    inverts: ClassVar[bool] = True  # the compliance of its rows, actuators locked

    def __call__(self, states: States) -> np.ndarray:
        return np.abs(self.largest - np.abs(self.force(states)[:, self.along]))

    def force(self, states: States) -> np.ndarray:
        """Forces (m, 3) N of the effector."""
        # delta_c + W_ca W_aa^-1 (delta_a - free_a) is delta_c with the actuators where they are, the tip free
        missing = states.delta_e[:, self.rows]
        if self.rest is not None:
            missing = missing + states.rest_e[:, self.rows] - self.rest
        locked = states.locked_compliance[:, self.rows[:, None], self.rows]
        return -np.linalg.solve(locked, missing[..., None])[..., 0]


@dataclass(frozen=True)
class OwnFunction:
    """A user's function of W (m, n, n), delta_free (m, n) and p (m, n_p), one number a design (m,), of `unit`."""

    name: str
    function: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
    sign: float = 1.0
    unit: str = ""

    def __call__(self, states: States) -> np.ndarray:
        """Values (m,) of the user's own function. SpecError where it fails or returns another shape, NumericalError
        where a value is not finite."""
        try:
            values = np.asarray(self.function(states.W, states.delta_free, states.p), float)
        except Exception as error:
            what = f"{type(error).__name__} with W {states.W.shape}, delta_free {states.delta_free.shape}, "
            raise SpecError(f"{what}p {states.p.shape}: {error}", where=self.name) from error
        if values.shape != (len(states),):
            raise SpecError(f"returned shape {values.shape} for {len(states)} designs", where=self.name)
        if not np.isfinite(values).all():
            raise NumericalError("returned a number that is not finite", where=self.name)
        return self.sign * values


def position_rows(rows: Rows, effector: str | None, where: str) -> np.ndarray:
    """Numbers (3,) of the x, y, z rows of an effector, the first unless named."""
    name = effector or rows.effectors[0].rsplit(".", 1)[0]
    wanted = [f"{name}.{axis}" for axis in "xyz"]
    if not set(wanted) <= set(rows.effectors):
        known = sorted({row.rsplit(".", 1)[0] for row in rows.effectors})
        raise SpecError(f"no effector '{name}' with x, y and z", where=where, do=f"known are {', '.join(known)}")
    return np.array([rows.effectors.index(row) for row in wanted])


def load_function(reference: str, base: Path, where: str) -> Callable:
    """'module:function' or 'path/to/file.py:function', the path from `base`. SpecError where there is none."""
    source, _, name = reference.rpartition(":")
    if not source or not name:
        raise SpecError(
            f"'{reference}' does not name a function", where=where, do="write module:function or file.py:function"
        )
    try:
        if source.endswith(".py"):
            plan = importlib.util.spec_from_file_location(f"cfem_user_{Path(source).stem}", base / source)
            module = importlib.util.module_from_spec(plan)
            plan.loader.exec_module(module)
        else:
            module = importlib.import_module(source)
        return getattr(module, name)
    except (ImportError, OSError, SyntaxError, AttributeError) as error:
        raise SpecError(f"'{reference}' cannot be loaded: {error}", where=where) from error
