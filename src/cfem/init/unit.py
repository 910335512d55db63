"""The unit of the numbers in a file that states none, guessed by the size of the body."""

import numpy as np

from cfem.core.errors import SpecError
from cfem.init.body.shape import Source
from cfem.init.question import Answer, Ask, Question, positive
from cfem.robot.checks.plausible import ROBOTS, SMALLEST, sides, size_doubts

# The first in which the body is of a soft robot's size is guessed: most files are in mm or m, and drawings in others.
_IN_MM = {"mm": 1.0, "m": 1000.0, "inch": 25.4, "cm": 10.0}
_USUAL = ("mm", "m")
_SLENDER = 2.5  # times the side of a cube of the same volume: about how long a body is that is not looked into


def unit_of(source: Source, ask: Ask) -> Answer | None:
    """mm of one unit of the file; None where it states its own."""
    if source.has_unit:
        return None
    unit, doubt, extent = natural_unit(source), unit_doubt(source), source.extent
    size = f"has {source.volume:.3g} cubic {unit}" if extent is None else f"measures {sides(extent)} {unit}"

    def read(text: str) -> float:
        value = positive(text if text.strip()[:1].isdigit() else f"1 {text.strip()}", "mm")
        if extent is not None:
            demand_unit(extent, value)
        return value

    text, why = f"What is one unit of the numbers in {source.path.name}?", f"the body then {size}"
    return ask(Question("unit", text, f"1 {unit}", f"{why}; UNCERTAIN: {doubt}" if doubt else why, read))


def natural_unit(source: Source) -> str:
    """Unit that a file without one probably has: the first in which the body is of a soft robot's size."""
    return _likely(_size(source))


def unit_doubt(source: Source) -> str:
    """Says where the natural unit is an unusual one, the body is of no soft robot's size, or of a more usual one in
    another unit; '' where there is no doubt."""
    size, unit = _size(source), natural_unit(source)
    fitting = _fitting(size)
    if not fitting:
        return f"soft robots measure {ROBOTS[0]:g} to {ROBOTS[1]:g} mm, and the body does in no usual unit"
    if unit in _USUAL and min(fitting, key=lambda candidate: _off(size, candidate)) == unit:
        return ""
    lengths = {name: size * in_mm for name, in_mm in _IN_MM.items() if name in ("mm", *fitting) and name != unit}
    about = "about " if source.extent is None else ""
    return " and ".join(f"in {name} it would be {about}{length:.3g} mm long" for name, length in lengths.items())


def demand_unit(extent: np.ndarray, unit: float) -> None:
    """SpecError, naming the unit to say instead, where no robot measures `extent` (3,) times `unit` mm."""
    doubts = size_doubts(extent * unit)
    if doubts:
        likely = _likely(float(extent.max()))
        measures = f", and the body measures {sides(extent * _IN_MM[likely])} mm"
        raise SpecError(doubts[0].partition(": check")[0], where="--unit", do=f"say --unit {likely}{measures}")


def _size(source: Source) -> float:
    """Largest side in the file's unit, or about so much of a CAD file."""
    return float(source.extent.max()) if source.extent is not None else _SLENDER * source.volume ** (1 / 3)


def _likely(size: float) -> str:
    return next(iter(_fitting(size)), "m" if size < SMALLEST else "mm")


def _fitting(size: float) -> list[str]:
    return [unit for unit, in_mm in _IN_MM.items() if ROBOTS[0] <= size * in_mm <= ROBOTS[1]]


def _off(size: float, unit: str) -> float:
    """Logarithm of how many times longer or shorter the body is than the middle of the range."""
    return abs(np.log(size * _IN_MM[unit] / np.sqrt(ROBOTS[0] * ROBOTS[1])))
