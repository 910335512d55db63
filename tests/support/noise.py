"""Streams of frames, and what a bad wire makes of them."""

from itertools import pairwise

from hypothesis import strategies as st

from cfem.plant.device.frame import Frame

SHORT, LONG = st.integers(0, 2**16 - 1), st.integers(0, 2**32 - 1)
FLOATS = st.floats(width=32, allow_nan=False)


def frames(most: int) -> st.SearchStrategy[Frame]:
    """Frames of up to `most` floats."""
    payload = st.lists(FLOATS, max_size=most).map(tuple)
    return st.builds(Frame, st.integers(0, 255), LONG, payload, SHORT, LONG, st.integers(0, 255))


FAULTS = st.tuples(st.sampled_from(["flip", "lose", "double", "insert"]), st.integers(0, 2**20), st.integers(0, 255))


def damaged(data: bytes, faults: list[tuple[str, int, int]]) -> bytes:
    """The bytes, one of them flipped, lost, doubled or new by each fault (how, where, what)."""
    stream = bytearray(data)
    for how, where, what in faults:
        place = where % (len(stream) + 1)
        if how == "insert" or place == len(stream):
            stream.insert(place, what)
        elif how == "flip":
            stream[place] ^= 1 << what % 8
        elif how == "lose":
            del stream[place]
        else:
            stream.insert(place, stream[place])
    return bytes(stream)


def pieces(data: bytes, cuts: list[int]) -> list[bytes]:
    """The bytes as they arrive, cut at some places."""
    places = sorted({cut % (len(data) + 1) for cut in cuts} | {0, len(data)})
    return [data[start:end] for start, end in pairwise(places)]
