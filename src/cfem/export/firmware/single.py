"""The C of a folder in single precision, for processors that compute in no other."""

import re
from pathlib import Path

from cfem.core.artefact.files import write_whole

LARGEST, SMALLEST = 3.4028234e38, 1.1754944e-38  # of a float, normal
FUNCTIONS = "sqrt|fabs|fmin|fmax|floor|ceil|round|exp|log|sin|cos|tan|acos|asin|atan2|atan|pow|hypot|fmod"
TOKEN = re.compile(
    r"(?P<kept>/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*')"
    r"|(?<![\w.])(?P<number>(?:\d+\.\d*|\.\d+|\d+(?=[eE]))(?:[eE][+-]?\d+)?)(?![\w.])"
    r"|\b(?P<type>double)\b|\b(?P<infinity>HUGE_VAL)\b"
    rf"|\b(?P<function>{FUNCTIONS})(?=\()",
    re.DOTALL,
)


def write_single(folder: Path) -> None:
    """Turns every C file of a folder from double into single precision: types, literals, functions of math.h. A folder
    that is single already stays as it is. Tolerances follow by CFEM_TOLERANCE of cfem_linear.h."""
    for file in sorted(folder.glob("*.[ch]")):
        text = file.read_text(encoding="utf-8")
        write_whole(file, TOKEN.sub(_single, text).encode())


def _single(token: re.Match) -> str:
    kind, text = token.lastgroup, token[0]
    if kind == "number":
        return _literal(text)
    if kind == "type":
        return "float"
    return {"kept": text, "infinity": "HUGE_VALF", "function": f"{text}f"}[kind]


def _literal(text: str) -> str:
    value = float(text)
    if value > LARGEST:
        return "HUGE_VALF"
    return "0.0f" if value < SMALLEST else f"{text}f"
