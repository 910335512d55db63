"""The stored WebAssembly is what its sources compile to."""

import json
import sys
from pathlib import Path

import pytest
from support.script import script

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wasm():
    return script("wasm")


def test_it_was_compiled_from_the_sources_that_are_here(wasm):
    stored = json.loads(wasm.RECORD.read_text())
    assert stored == json.loads(json.dumps(wasm.record(wasm.CODE.read_bytes()))), "sources changed: run `make wasm`"


def test_every_file_that_it_includes_is_among_them(wasm):
    """And a change of any is seen."""
    known = wasm.hashes()
    included = {
        line.split('"')[1]
        for name in known
        for line in (wasm.EXPORT / name).read_text().splitlines()
        if line.startswith('#include "')
    }
    assert included <= {Path(name).name for name in known}
    assert set(wasm.SOURCES) <= set(known)


@pytest.mark.slow
def test_a_rebuild_is_the_same_module(wasm, monkeypatch):
    monkeypatch.setattr(sys, "argv", ["wasm.py", "--check"])
    assert wasm.main() == 0
