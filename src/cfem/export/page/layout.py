"""The blocks of bytes that a page's WebAssembly reads, as web/cfem_data.h and web/cfem_motion_data.h declare them."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from cfem.core.errors import InputError

WEB = files("cfem.export.page") / "web"
LIST = re.compile(r"#define (\w+)\(X\)((?: \\\n +X\([^)]*\))+)")
ENTRY = re.compile(r"X\((\w+), ([^)]*)\)")


@dataclass(frozen=True)
class Count:
    """A whole number of a block: its name in C, the least and the most of it, and what it counts."""

    name: str
    least: int
    most: int
    what: str


@dataclass(frozen=True)
class BlockLayout:
    """The lists of a header.

    counts: whole numbers
    integers, vectors, matrices, trees: names of arrays and series, in the order of the block
    room: words that the header defines as numbers"""

    counts: tuple[Count, ...]
    integers: tuple[str, ...]
    vectors: tuple[str, ...]
    matrices: tuple[str, ...]
    trees: tuple[str, ...]
    room: Mapping[str, int]

    def parts(self, sizes: Mapping[str, int], arrays: Mapping[str, np.ndarray]) -> list[np.ndarray]:
        """Counts and arrays in the order of the block. InputError where the page has no room for a count."""
        for count in self.counts:
            if sizes[count.name] > count.most:
                what = f"the page has room for {count.most} {count.what}, and this robot has {sizes[count.name]}"
                raise InputError(what, do="export C")
        parts = [np.array([sizes[count.name] for count in self.counts], "<i4")]
        parts += [np.asarray(arrays[name], "<i4") for name in self.integers]
        parts += [np.asarray(arrays[name], "<f8") for name in self.vectors]
        return parts + [np.asarray(row, "<f8") for name in self.matrices for row in arrays[name]]


@cache
def layout(prefix: str, *headers: str) -> BlockLayout:
    """Lists whose names begin with a prefix; headers: of web/, later ones with words of earlier ones."""
    text = "".join((WEB / name).read_text(encoding="utf-8") for name in headers)
    words = dict(re.findall(r"^#define (CFEM_\w+) (\w+)$", text, re.MULTILINE))
    lists = {
        name.removeprefix(prefix): ENTRY.findall(body) for name, body in LIST.findall(text) if name.startswith(prefix)
    }

    def number(word: str) -> int:
        return int(word) if word.isdigit() else number(words[word])

    def count(name: str, rest: str) -> Count:
        least, most, what = rest.split(", ")
        return Count(name, number(least), number(most), what.strip('"'))

    names = (tuple(name for name, _ in lists.get(kind, ())) for kind in ("INTEGERS", "VECTORS", "MATRICES", "TREES"))
    room = {word: number(value) for word, value in words.items() if value.isdigit() or value in words}
    return BlockLayout(tuple(count(*entry) for entry in lists["COUNTS"]), *names, room)


def robot_layout() -> BlockLayout:
    """Block of a robot at rest."""
    return layout("CFEM_", "cfem_data.h")


def motion_layout() -> BlockLayout:
    """Block of a robot in motion."""
    return layout("CFEM_MOTION_", "cfem_data.h", "cfem_motion_data.h")


def joined(parts: Iterable[np.ndarray | bytes]) -> bytes:
    """Bytes of a block; each part begins at a multiple of eight."""
    return b"".join(data + bytes(-len(data) % 8) for data in map(bytes, parts))
