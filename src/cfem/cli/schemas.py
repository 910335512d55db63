"""JSON Schemas of the specs, from the same models that validate them."""

import json
from functools import cache
from pathlib import Path

from cfem.core.artefact.files import write_whole
from cfem.core.errors import GateError
from cfem.core.kinds import KINDS, model_of
from cfem.core.spec import json_schema


@cache
def schema_of(kind: str) -> str:
    """Text of the schema of a kind of spec."""
    return json.dumps(json_schema(model_of(kind)), indent=1, sort_keys=True) + "\n"


def write_schemas(out: Path, check: bool) -> str:
    """Writes all; with `check` writes none and raises GateError where one differs."""
    for kind in KINDS:
        path, text = out / f"{kind}.json", schema_of(kind)
        if check and (not path.exists() or path.read_text(encoding="utf-8") != text):
            raise GateError("differs from the specs", where=str(path), do="run cfem schema")
        if not check:
            write_whole(path, text.encode())
    return f"{len(KINDS)} schemas {'are current' if check else 'written'} in {out}"
