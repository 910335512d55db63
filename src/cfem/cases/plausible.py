"""What calibrated values can hardly be: then something else is not in the model, and they stand for it."""

from collections.abc import Mapping, Sequence
from typing import Any

from cfem.cases.outcome import shown
from cfem.cases.unknowns import Sought

# last word of a key: smallest and largest in its unit, and of what
_RANGES = {
    "density": (0.9e-9, 1.4e-9, "rubbers have"),
    "friction": (0.0, 1.0, "cables in channels of rubber, metal or plastic have"),
    "scale": (0.5, 2.0, "drives of which something is known are within"),
}


def implausible(unknowns: Sequence[Sought], estimates: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A sentence for each value whose whole interval lies outside what is known of such."""
    found = []
    for one in unknowns:
        word = one.keys[0].rpartition(".")[2]
        if word not in _RANGES or (word == "scale" and not one.known):
            continue
        low, high, whose = _RANGES[word]
        value, (least, most), unit = (estimates[one.name][key] for key in ("value", "interval", "unit"))
        if most < low or least > high:
            (number, name), ends = shown(value, unit), [f"{shown(end, unit)[0]:.4g}" for end in (low, high)]
            found.append(
                f"{one.name} {number:.4g}{' ' + name if name else ''} is implausible ({whose} {' to '.join(ends)}): it "
                "stands for something that the model lacks"
            )
    return found
