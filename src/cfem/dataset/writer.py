"""Rows to a Parquet file that is whole or absent, every page with its checksum."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from cfem.core.artefact.files import write_whole
from cfem.dataset.schema import content


def table_bytes(table: pa.Table) -> bytes:
    """Bytes of a Parquet file."""
    buffer = pa.BufferOutputStream()
    pq.write_table(table, buffer, compression="zstd", write_page_checksum=True)
    return buffer.getvalue().to_pybytes()


def write_table(path: Path, table: pa.Table) -> None:
    """Made in memory and put in place by one rename. Raises DiskError."""
    write_whole(path, table_bytes(table))


def write_columns(path: Path, columns: Mapping[str, Sequence[Any] | np.ndarray], meta: Mapping[str, Any]) -> None:
    """A table of results: columns of numbers or texts, or of vectors (m, k), and what is known of them, as JSON under
    the key `cfem` of its schema."""
    table = pa.table({name: _column(values) for name, values in columns.items()})
    write_table(path, table.replace_schema_metadata({"cfem": json.dumps(meta)}))


def write_records(path: Path, records: Sequence[Mapping[str, Any]], meta: Mapping[str, Any]) -> None:
    """Writes a table as `write_columns` does, from one mapping a row, all with the keys of the first."""
    write_columns(path, {key: [row[key] for row in records] for key in records[0]}, meta)


def _column(values: Sequence[Any] | np.ndarray) -> pa.Array:
    if np.ndim(values[0]) == 0:
        return pa.array(values)
    vectors = np.ascontiguousarray(values)
    return pa.FixedSizeListArray.from_arrays(pa.array(vectors.ravel()), vectors.shape[1])


def content_hash(tables: Mapping[str, pa.Table]) -> str:
    """SHA-256 of what the splits hold: equal for equal states, whoever solved them, where and how fast."""
    digest = hashlib.sha256()
    for split in sorted(tables):
        for part in (split.encode(), *content(tables[split])):
            digest.update(len(part).to_bytes(8, "little"))
            digest.update(part)
    return digest.hexdigest()
