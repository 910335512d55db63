"""Sets of elements of an Abaqus input file by their numbers there: of meshio's, those that `*ELEMENT` names are of the
right elements only where each block of elements names one of its own."""

from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path

import meshio
import numpy as np

from cfem.core.errors import InputError

Section = tuple[str, dict[str, str], list[list[str]]]


def element_sets(path: Path, blocks: Sequence[meshio.CellBlock]) -> dict[str, list[np.ndarray]]:
    """Members of each set in each block of cells, by its name as it is first written. Empty where other files are
    included. InputError where a set is said to hold another that is not there.

    blocks: of the file, in its order"""
    numbers: list[np.ndarray] = []
    sets: dict[str, list[int]] = {}
    spelled: dict[str, str] = {}
    for keyword, options, rows in _sections(path):
        if keyword == "INCLUDE":
            return {}
        if keyword == "ELEMENT":
            width = blocks[len(numbers)].data.shape[1] + 1
            cells = np.array([int(cell) for cell in chain.from_iterable(rows)])
            numbers.append(cells.reshape(-1, width)[:, 0])
        if keyword in ("ELEMENT", "ELSET") and (name := options.get("ELSET")):
            known = sets.setdefault(name.upper(), [])
            spelled.setdefault(name.upper(), name)
            known += numbers[-1].tolist() if keyword == "ELEMENT" else _members(rows, "GENERATE" in options, sets, path)
    return {
        spelled[name]: [np.flatnonzero(np.isin(of_block, members)) for of_block in numbers]
        for name, members in sets.items()
    }


def _members(rows: list[list[str]], generate: bool, sets: dict[str, list[int]], path: Path) -> list[int]:
    """Numbers of elements that the data of *ELSET list: first, last and step where they generate."""
    if generate:
        ranges = [[int(cell) for cell in row] for row in rows]
        return [number for first, last, *step in ranges for number in range(first, last + 1, *step)]
    members: list[int] = []
    for cell in chain.from_iterable(rows):
        if cell.isnumeric():
            members.append(int(cell))
        elif cell.upper() in sets:
            members += sets[cell.upper()]
        else:
            raise InputError(f"has a set that holds '{cell}', which is no set", where=str(path), do="write it again")
    return members


def _sections(path: Path) -> Iterator[Section]:
    """Keyword, options and cells of the rows below it, of each part of the file; names in capitals, but not values."""
    section: Section | None = None
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        if line.startswith("**") or not line.strip():
            continue
        if line.startswith("*"):
            if section is not None:
                yield section
            keyword, *options = (part.strip() for part in line[1:].split(","))
            pairs = [option.partition("=") for option in options]
            section = keyword.upper(), {key.strip().upper(): value.strip() for key, _, value in pairs}, []
        elif section is not None:
            section[2].append([cell for cell in map(str.strip, line.split(",")) if cell])
    if section is not None:
        yield section
