"""The columns of a dataset: names, types, units, and the metadata that makes a file speak for itself."""

import json
from dataclasses import asdict, dataclass
from typing import Any

import pyarrow as pa

from cfem.condensed import Rows

FORMAT = 1
KEY = b"cfem"
# What made the numbers, not what they are: left out of the content hash.
_PROVENANCE = ("versions", "made_from")


@dataclass(frozen=True)
class Column:
    """unit: of every number in it, '' for text and counts, '1' for ratios; size: which numbers, None for a scalar;
    state: True where a row whose solve failed has no value."""

    name: str
    kind: pa.DataType
    unit: str = ""
    size: str | None = None
    state: bool = False


_F, _N, _S = pa.float64(), pa.int64(), pa.string()
COLUMNS = (
    Column("id", _N),
    Column("split", _S),
    Column("status", _S),
    Column("reason", _S),
    Column("u", _F, "1", "actuators"),
    Column("delta_a", _F, "mm", "actuators", state=True),
    Column("delta_e", _F, "mm", "effectors", state=True),
    Column("lambda_a", _F, "N", "actuators", state=True),
    Column("W", _F, "mm/N", "upper triangle", state=True),
    Column("delta_free", _F, "mm", "rows", state=True),
    Column("energy", _F, "N mm", state=True),
    Column("slack", pa.bool_(), "", "actuators", state=True),
    Column("iterations", _N),
    Column("factorizations", _N),
    Column("steps", _N),
    Column("residual", _F, "1"),
    Column("seconds", _F, "s"),
)


def schema(rows: Rows, meta: dict[str, Any]) -> pa.Schema:
    """Arrow schema of a robot's dataset; lists have a fixed size. `meta` (plain JSON data) goes into the file under the
    key 'cfem', with the format's version, the names of the rows and the unit of each column."""
    sizes = {"actuators": rows.n_a, "effectors": rows.n_e, "rows": rows.n, "upper triangle": rows.n * (rows.n + 1) // 2}
    fields = [
        pa.field(
            column.name, column.kind if column.size is None else pa.list_(column.kind, sizes[column.size]), column.state
        )
        for column in COLUMNS
    ]
    units = {column.name: column.unit for column in COLUMNS if column.unit}
    full = {"format": FORMAT, "rows": asdict(rows), "units": units, **meta}
    return pa.schema(fields, metadata={KEY: json.dumps(full, sort_keys=True, allow_nan=False).encode()})


def metadata(table: pa.Table) -> dict[str, Any]:
    """What `schema` put into a file; empty in a file of others. Raises ValueError where it is damaged."""
    return json.loads((table.schema.metadata or {}).get(KEY, b"{}"))


def rows_of(meta: dict[str, Any]) -> Rows:
    return Rows(**{block: tuple(names) for block, names in meta["rows"].items()})


def content(table: pa.Table) -> dict[str, Any]:
    """All that identifies a dataset, as plain data: values and meaning, without the time it took and what made it."""
    meta = {key: value for key, value in metadata(table).items() if key not in _PROVENANCE}
    return {"meta": meta, "columns": table.drop_columns(["seconds"]).to_pydict()}
