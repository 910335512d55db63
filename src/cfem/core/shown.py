"""Numbers as a person reads them: two or three digits, and a unit that suits their size; lines that fit."""

import re
import shutil
from textwrap import wrap

HOLD = "\N{NO-BREAK SPACE}"


def duration(seconds: float) -> str:
    """'153 us', '2.4 s', '12 min'."""
    if seconds == 0:
        return "0 s"
    if seconds < 120:
        return _scaled(seconds, (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)))
    return _scaled(seconds, (("h", 3600.0), ("min", 60.0)) if seconds >= 7200 else (("min", 60.0),))


def length(mm: float) -> str:
    """'0.45 mm', '3.2 um', '0.021 nm'."""
    if mm == 0:
        return "0 mm"
    return _scaled(mm, (("m", 1e3),) if abs(mm) >= 1e3 else (("mm", 1.0), ("um", 1e-3), ("nm", 1e-6)), 0.1)


def size(count: float) -> str:
    """Of bytes: '14.8 kB'."""
    return _scaled(count, (("GB", 1e9), ("MB", 1e6), ("kB", 1e3), ("bytes", 1.0)))


def folded(line: str) -> list[str]:
    """At the width of the terminal, 80 columns where there is none; a number stays with its unit."""
    width, held = shutil.get_terminal_size().columns, re.sub(r"(?<=\d) (?=[^\s\d])", HOLD, line)
    parts = wrap(held, width, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
    return [part.replace(HOLD, " ") for part in parts]


def _scaled(value: float, units: tuple[tuple[str, float], ...], least: float = 1.0) -> str:
    """In the first of the units (largest first) of which it is `least` or more, else in the last."""
    name, factor = next((unit for unit in units if abs(value) >= least * unit[1]), units[-1])
    return f"{float(f'{value / factor:.3g}'):g} {name}"
