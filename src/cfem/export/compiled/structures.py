"""C structures of an exported folder as ctypes, read from its headers, which alone declare what they hold."""

import ast
import ctypes
import operator
import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from cfem.export.compiled.build import STANDARD, demand_compiler, files_of, run

TYPES: dict[str, type] = {
    "double": ctypes.c_double,
    "float": ctypes.c_float,
    "int": ctypes.c_int,
    "long": ctypes.c_long,
    "unsigned": ctypes.c_uint,
    "unsigned char": ctypes.c_ubyte,
    "unsigned int": ctypes.c_uint,
    "uint8_t": ctypes.c_uint8,
    "uint16_t": ctypes.c_uint16,
    "uint32_t": ctypes.c_uint32,
}
STRUCTURE = re.compile(r"typedef struct \{([^{}]*)\} (cfem_\w+);")
SAME = re.compile(r"typedef (\w+(?: char)?) (cfem_\w+);")
CALL = re.compile(r"\w+ \(\*(\w+)\)\(.*\)")
MEMBER = re.compile(r"(?:const )?(unsigned char|unsigned int|\w+) (.*)")
DECLARATOR = re.compile(r"(\**) ?(\w+)((?:\[[^\]]+\])*)")
CHOICE = re.compile(r"(\d+) \? ([^?:]+) : (\d+)")
OPERATORS: dict[type, Callable[[int, int], int]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.floordiv,
}


def structures(folder: Path, header: str) -> dict[str, type]:
    """Types by name, those of a header of the folder and of what it includes. InputError where there is no compiler."""
    return _structures(folder, header, files_of(folder))


@lru_cache(maxsize=64)
def _structures(folder: Path, header: str, files: tuple[tuple[str, str], ...]) -> dict[str, type]:
    """Types by name, read once for the same files: names and SHA-256 of the folder's."""
    text = " ".join(run([demand_compiler(), *STANDARD, "-E", "-P", str((folder / header).resolve())], folder).split())
    types = dict(TYPES)
    types |= {name: types[known] for known, name in SAME.findall(text) if known in types}
    for body, name in STRUCTURE.findall(text):
        fields = [field for line in body.split(";") if line.strip() for field in _fields(line.strip(), types)]
        types[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return types


def _fields(line: str, types: dict[str, type]) -> list[tuple[str, type]]:
    """Fields of one declaration in a structure."""
    if call := CALL.fullmatch(line):
        return [(call[1], ctypes.c_void_p)]
    kind, declarators = MEMBER.fullmatch(line).groups()
    fields = []
    for pointer, name, sizes in (DECLARATOR.fullmatch(text.strip()).groups() for text in declarators.split(",")):
        field = ctypes.c_void_p if pointer else types[kind]
        for size in reversed(re.findall(r"\[([^\]]+)\]", sizes)):
            field = field * _size(ast.parse(CHOICE.sub(r"\2 if \1 else \3", size), mode="eval").body)
        fields.append((name, field))
    return fields


def _size(node: ast.expr) -> int:
    """Value of an integer expression of C."""
    if isinstance(node, ast.IfExp):
        return _size(node.body if _size(node.test) else node.orelse)
    if isinstance(node, ast.BinOp):
        return OPERATORS[type(node.op)](_size(node.left), _size(node.right))
    return int(node.value)


def numbers(field: ctypes.Array) -> np.ndarray:
    """An array of a structure as NumPy has it; both share their memory."""
    return np.ctypeslib.as_array(field)
