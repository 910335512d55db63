"""Arrays and facts about them as one text for a page: compressed, with its length and a checksum, so that a page
whose data were cut or changed says so. web/data.js reads it."""

import base64
import json
import zlib
from dataclasses import dataclass
from typing import Any

import numpy as np

MAGIC = b"cfempage"


@dataclass(frozen=True)
class Packed:
    """Data of a page as text.

    text: base64 of the compressed bytes
    bytes: how many they are before
    crc: CRC-32 of them"""

    text: str
    bytes: int
    crc: int


@dataclass(frozen=True)
class Fixed:
    """An array of real numbers as multiples of a step, one for each of its first index where `steps` has several:
    what of it is lost is half a step."""

    values: np.ndarray
    steps: np.ndarray

    def integers(self) -> np.ndarray:
        """Multiples of the step."""
        steps = self.steps.reshape(-1, *[1] * (self.values.ndim - 1))
        return np.rint(self.values / steps).astype("<i4")


def pack(facts: dict[str, Any], arrays: dict[str, np.ndarray | Fixed | bytes]) -> Packed:
    """Facts (JSON) and arrays of a page, packed. Bytes stay as they are; whole numbers and float32 take 32 bits, others
    are Fixed or double."""
    index, parts = {}, []
    for name, array in arrays.items():
        described, data = _described(array)
        index[name] = {**described, "bytes": len(data)}
        parts.append(data + bytes(-len(data) % 8))
    head = json.dumps({**facts, "arrays": index}, ensure_ascii=False, allow_nan=False).encode()
    head += b" " * (-len(head) % 8)
    content = b"".join([MAGIC, np.uint32(len(head)).astype("<u8").tobytes(), head, *parts])
    return Packed(base64.b64encode(zlib.compress(content, 9)).decode(), len(content), zlib.crc32(content))


def _described(array: np.ndarray | Fixed | bytes) -> tuple[dict[str, Any], bytes]:
    """Description of an array for the page, and its bytes."""
    if isinstance(array, bytes):
        return {"type": "bytes"}, array
    if isinstance(array, Fixed):
        return {"type": "fixed", "steps": array.steps.tolist()}, _planes(array.integers())
    if array.dtype == np.float32:
        return {"type": "single"}, _planes(array.view("<i4"))
    if np.issubdtype(array.dtype, np.integer):
        return {"type": "whole"}, _planes(array.astype("<i4"))
    return {"type": "double"}, array.astype("<f8").tobytes()


def _planes(integers: np.ndarray) -> bytes:
    """First all lowest bytes, then all next ones: high bytes are much alike, and compress."""
    return integers.reshape(-1, 1).view(np.uint8).T.tobytes()
