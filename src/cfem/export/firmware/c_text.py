"""Numbers, arrays and text as C."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cfem.core.artefact.files import write_whole

WIDTH = 110
KINDS = {"f4": "float", "f8": "double", "u1": "uint8_t", "u2": "uint16_t", "u4": "uint32_t", "i4": "int", "i8": "int"}


def number(value: float, scalar: str) -> str:
    """The shortest text that reads back as the same number of the scalar type, float or double."""
    if np.isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    if scalar == "float":
        text = repr(float(str(np.float32(value))))
        return f"{text}f"
    return repr(float(value))


def array(name: str, values: np.ndarray, scalar: str) -> tuple[str, str]:
    """Declaration and definition of a constant array of any shape; scalar: its C type ('cfem_real' stands for what
    `c_numbers` makes of it)."""
    shape = "".join(f"[{size}]" for size in values.shape)
    return f"extern const {scalar} {name}{shape};", f"const {scalar} {name}{shape} = {braces(values)};"


def braces(values: np.ndarray) -> str:
    """An initialiser."""
    if values.ndim > 1:
        return "{" + ",\n".join(braces(row) for row in values) + "}"
    if np.issubdtype(values.dtype, np.integer):
        texts = [str(int(value)) for value in values]
    else:
        texts = [number(value, "float" if values.dtype == np.float32 else "double") for value in values]
    lines, line = [], ""
    for text in texts:
        if line and len(line) + len(text) > WIDTH:
            lines.append(line)
            line = ""
        line += f"{text}, "
    return "{" + "\n ".join([*lines, line]).rstrip(", ") + "}"


def string(text: str) -> str:
    """A string literal of the text in UTF-8. Octal escapes end after three digits; `?` could begin a trigraph."""
    plain = re.compile(rb"[A-Za-z0-9 _.,:;()\[\]/+*=<>-]")
    pieces = (bytes([byte]) for byte in text.encode("utf-8", "replace"))
    return '"' + "".join(piece.decode() if plain.match(piece) else f"\\{piece[0]:03o}" for piece in pieces) + '"'


def comment(text: str) -> str:
    """A comment of one line, in which whatever could end it is replaced."""
    return f"/* {re.sub(r'[^A-Za-z0-9 _.,:-]', '_', text)} */"


def defines(values: Mapping[str, object]) -> str:
    return "".join(f"#define {name} {value}\n" for name, value in values.items())


def write_constants(
    file: Path,
    heading: str,
    words: Mapping[str, object],
    prefix: str,
    constants: Mapping[str, np.ndarray],
    declared: str = "",
    defined: str = "",
) -> int:
    """Writes file.h and file.c: the words as `#define`s, the arrays under `prefix` and their names; the bytes of these.
    heading: the comment that begins the header; declared: what comes next there; defined: what ends the source."""
    guard = f"{file.name.upper()}_H"
    header = [f"{heading}\n#ifndef {guard}\n#define {guard}\n\n#include <stdint.h>\n{declared}\n{defines(words)}\n"]
    body = [f'#include "{file.name}.h"\n\n#include <math.h>\n\n']
    for name, values in constants.items():
        declaration, definition = array(f"{prefix}{name}", values, KINDS[values.dtype.str[1:]])
        header.append(declaration + "\n")
        body.append(definition + "\n\n")
    write_whole(file.with_suffix(".h"), "".join([*header, "\n#endif\n"]).encode())
    write_whole(file.with_suffix(".c"), "".join([*body, defined]).encode())
    return sum(values.nbytes for values in constants.values())
