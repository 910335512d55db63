"""Calibrated values that can hardly be: then something else is not in the model, and they stand for it."""

from collections.abc import Mapping, Sequence
from typing import Any

from cfem.identify.cases.text import shown
from cfem.identify.cases.unknowns import CaseUnknown

# last word of a key: smallest and largest in its unit, and of what
_RANGES = {
    "density": (0.9e-9, 1.4e-9, "rubbers have"),
    "friction": (0.0, 1.0, "cables in channels of rubber, metal or plastic have"),
    "scale": (0.5, 2.0, "drives of which something is known are within"),
}


def implausible(unknowns: Sequence[CaseUnknown], estimates: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """A sentence for each value whose whole interval lies outside what is known of such."""
    sentences = []
    for unknown in unknowns:
        word = unknown.keys[0].rpartition(".")[2]
        if word not in _RANGES or (word == "scale" and not unknown.known):
            continue
        low, high, owner = _RANGES[word]
        value, (least, most), unit = (estimates[unknown.name][key] for key in ("value", "interval", "unit"))
        if most < low or least > high:
            number, name = shown(value, unit)
            ends = " to ".join(f"{shown(end, unit)[0]:.4g}" for end in (low, high))
            sentences.append(
                f"{unknown.name} {number:.4g}{' ' + name if name else ''} is implausible ({owner} {ends}): it "
                "stands for something that the model lacks"
            )
    return sentences
