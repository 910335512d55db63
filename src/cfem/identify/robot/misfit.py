"""What a fit leaves of the measurements, beside how much these change."""

from dataclasses import dataclass

import numpy as np

from cfem.core.console.shown import length
from cfem.identify.robot.calibration import Calibration

LARGE = 0.1  # of the largest change: a fit that leaves more explains less than 99 % of the squares


@dataclass(frozen=True)
class Misfit:
    """What is left of numbers of one kind.

    name:   'effectors', 'orientations', 'forces' or 'displacements' of actuators
    unit:   of both numbers
    rms:    root mean square of computed less measured
    change: largest change that was measured or computed: of places from their mean or from rest, of others from 0"""

    name: str
    unit: str
    rms: float
    change: float

    @property
    def share(self) -> float:
        """Residual as a share of the largest change."""
        return self.rms / self.change if self.change > 0 else 0.0

    @property
    def words(self) -> str:
        """'0.018 mm of the effectors (they change by up to 49 mm)'."""
        if self.unit == "mm":
            return f"{length(self.rms)} of the {self.name} (they change by up to {length(self.change)})"
        return f"{self.rms:.3g} {self.unit} of the {self.name} (they change by up to {self.change:.3g} {self.unit})"


def misfits(calibration: Calibration) -> list[Misfit]:
    """Misfit of each kind of numbers that was measured."""
    kinds: dict[tuple[str, str], list[np.ndarray]] = {}
    problem, effectors = calibration.problem, calibration.problem.family.rows.effectors
    for name in problem.names:
        numbers = problem.numbers_of(name)
        measured = problem.target[numbers]
        change = measured
        if name in effectors:
            travel = np.abs(calibration.states.delta_e[:, effectors.index(name)]).max()
            change = np.maximum(np.abs(measured - measured.mean()), travel)
        kinds.setdefault(_kind(calibration, name), []).append(np.stack([calibration.residuals[numbers], change]))
    summed = []
    for (name, unit), parts in kinds.items():
        residuals, changes = np.hstack(parts)
        summed.append(Misfit(name, unit, float(np.sqrt((residuals**2).mean())), float(np.abs(changes).max())))
    return summed


def _kind(calibration: Calibration, name: str) -> tuple[str, str]:
    """Kind and unit of the numbers of one name."""
    family = calibration.problem.family
    row, _, quantity = name.rpartition(".")
    if row in family.rows.actuators:
        displacement, force = family.actuator_units[family.rows.actuators.index(row)]
        return (f"{quantity}s", force if quantity == "force" else displacement)
    turns = dict(zip(family.rows.effectors, family.rows.turns, strict=True))
    return ("orientations", "rad") if turns.get(name, turns.get(row)) else ("effectors", "mm")
