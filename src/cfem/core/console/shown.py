"""Numbers as a person reads them: two or three digits, and a unit that suits their size; lines that fit.

Commands, reports and pages all take the unit of a length or a time from here, so that they agree."""

import re
import shutil
from collections.abc import Sequence
from textwrap import wrap

LENGTHS = (("mm", 1.0), ("µm", 1e-3), ("nm", 1e-6))
TIMES = (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6))
HOLD = "\N{NO-BREAK SPACE}"


def duration(*seconds: float, digits: int = 3) -> str:
    """'153 µs', '2.4 s', '12 min'; of several, in the unit of the longest: '0.12 / 1.5 ms'."""
    most = max(map(abs, seconds))
    units = TIMES if most < 120 else (("h", 3600.0),) if most >= 7200 else (("min", 60.0),)
    return _scaled(seconds, _unit(most, units), digits)


def length(*mm: float, digits: int = 3) -> str:
    """'0.45 mm', '3.2 µm', '< 1 nm'; of several, in the unit of the largest: '1.2 / 7.5 nm'. An atom measures a tenth
    of a nanometre: digits below one mean nothing to a person."""
    most = max(map(abs, mm))
    return "< 1 nm" if 0 < most < LENGTHS[-1][1] else _scaled(mm, length_unit(most), digits)


def length_unit(mm: float) -> tuple[str, float]:
    """Unit in which `length` writes lengths up to `mm`, and the mm of that unit."""
    return _unit(abs(mm), ((("m", 1e3),) if abs(mm) >= 1e3 else LENGTHS), 0.1)


def stress(mpa: float) -> str:
    """Stress of MPa in words: '22.2 kPa', four digits."""
    size = abs(mpa)
    unit = _unit(size, (("GPa", 1e3), ("MPa", 1.0))) if size >= 1 else _unit(size, (("kPa", 1e-3), ("Pa", 1e-6)), 0.1)
    return _scaled((mpa,), unit if mpa else ("kPa", 1e-3), 4)


def size(count: float) -> str:
    """Size of so many bytes in words: '14.8 kB'."""
    return _scaled((count,), _unit(count, (("GB", 1e9), ("MB", 1e6), ("kB", 1e3), ("bytes", 1.0))))


def counted(number: int, noun: str, plural: str = "") -> str:
    """So many things in words: '1 edge', '3 edges'; plural: where it is not the noun with an s."""
    return f"{number} {noun if number == 1 else plural or f'{noun}s'}"


def times(ratio: float) -> str:
    """Ratio in words, two digits: '830', '2.5'."""
    return _digits(ratio, 2)


def folded(line: str) -> list[str]:
    """Lines of a text at the width of the terminal, 80 columns where there is none; a number stays with its unit."""
    width, held = shutil.get_terminal_size().columns, re.sub(r"(?<=\d) (?=[^\s\d])", HOLD, line)
    parts = wrap(held, width, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
    return [part.replace(HOLD, " ") for part in parts]


def _unit(most: float, units: Sequence[tuple[str, float]], least: float = 1.0) -> tuple[str, float]:
    """The first of the units (largest first) of which this is `least` or more, else the last; for zero the one of
    factor 1."""
    if not most:
        return next((unit for unit in units if unit[1] == 1.0), units[-1])
    return next((unit for unit in units if most >= least * unit[1]), units[-1])


def _scaled(values: Sequence[float], unit: tuple[str, float], digits: int = 3) -> str:
    name, factor = unit
    return f"{' / '.join(_digits(value / factor, digits) for value in values)} {name}"


def _digits(value: float, digits: int) -> str:
    return f"{float(f'{value:.{digits}g}'):g}"
