"""What a page carries: packed and read back by the format's description, to the precision that it promises."""

import base64
import json
import zlib

import numpy as np
import pytest

from cfem.export.page.data import MAGIC, Fixed, Packed, pack


def unpacked(packed: Packed) -> tuple[dict, dict[str, bytes]]:
    whole = zlib.decompress(base64.b64decode(packed.text))
    assert len(whole) == packed.bytes and zlib.crc32(whole) == packed.crc and whole.startswith(MAGIC)
    length = int.from_bytes(whole[8:16], "little")
    said, at, found = json.loads(whole[16 : 16 + length]), 16 + length, {}
    for name, one in said["arrays"].items():
        assert at % 8 == 0
        found[name] = whole[at : at + one["bytes"]]
        at += one["bytes"] + -one["bytes"] % 8
    assert at == len(whole)
    return said, found


def whole_numbers(planes: bytes) -> np.ndarray:
    """By their four planes of bytes, lowest first."""
    count = len(planes) // 4
    parts = [np.frombuffer(planes, np.uint8)[i * count : (i + 1) * count].astype(np.int64) for i in range(4)]
    value = sum(part << (8 * i) for i, part in enumerate(parts))
    return np.where(value >= 2**31, value - 2**32, value)


def test_arrays_come_back():
    rng = np.random.default_rng(0)
    reals, whole = rng.normal(size=(2, 5, 3)) * [[[100.0]], [[0.01]]], rng.integers(-9, 2**31, (4, 3))
    steps = np.array([2e-7, 1e-10])
    said, found = unpacked(pack({"name": "é"}, {"a": Fixed(reals, steps), "b": whole, "c": b"abc", "d": reals}))
    assert said["name"] == "é" and found["c"] == b"abc"
    assert (whole_numbers(found["b"]).reshape(whole.shape) == whole).all()
    off = np.abs(whole_numbers(found["a"]).reshape(reals.shape) * steps[:, None, None] - reals)
    assert (off <= 0.501 * steps[:, None, None]).all()
    assert (np.frombuffer(found["d"]) == reals.ravel()).all()


def test_a_number_that_is_none_is_no_json():
    with pytest.raises(ValueError, match="JSON"):
        pack({"x": float("nan")}, {})
