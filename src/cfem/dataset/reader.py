"""A Parquet file to arrays: converged rows as numbers, failed rows as a table with their reasons."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from cfem.condensed import Rows, unpack_upper
from cfem.core.errors import InputError
from cfem.dataset.schema import COLUMNS, FORMAT, metadata, rows_of

CONVERGED = "converged"


@dataclass(frozen=True)
class Dataset:
    """Converged states of one robot, m of them, in the order of their plan.

    id (m,) number of the row in its plan; u (m, n_a) its place in the unit cube; delta_a (m, n_a) mm; delta_e (m, n_e)
    mm from the rest position; lambda_a (m, n_a) N; W (m, n, n) mm/N and delta_free (m, n) mm in the order of `rows`;
    energy (m,) N mm; slack (m, n_a) actuators that carry nothing; cost: iterations, factorizations, steps, residual and
    seconds by name, (m,) each; failed: the rows that did not converge, as stored; meta: rest_e, reach, length, ..."""

    rows: Rows
    id: np.ndarray
    u: np.ndarray
    delta_a: np.ndarray
    delta_e: np.ndarray
    lambda_a: np.ndarray
    W: np.ndarray
    delta_free: np.ndarray
    energy: np.ndarray
    slack: np.ndarray
    cost: dict[str, np.ndarray]
    failed: pa.Table
    meta: dict[str, Any]

    def __len__(self) -> int:
        return len(self.id)


def read_dataset(path: Path) -> Dataset:
    """Raises InputError naming the file where it is missing, damaged, or no dataset of cfem."""
    table = read_table(path)
    meta = metadata(table)
    solved = pc.equal(table["status"], CONVERGED)
    good = table.filter(solved)
    return Dataset(
        rows=rows_of(meta),
        **{name: column_array(good, name) for name in ("id", "u", "delta_a", "delta_e", "lambda_a", "delta_free")},
        W=unpack_upper(column_array(good, "W")),
        energy=column_array(good, "energy"),
        slack=column_array(good, "slack"),
        cost={
            name: column_array(good, name) for name in ("iterations", "factorizations", "steps", "residual", "seconds")
        },
        failed=table.filter(pc.invert(solved)),
        meta=meta,
    )


def read_table(path: Path) -> pa.Table:
    """The file as it is, its page checksums verified. Raises InputError."""
    try:
        table = pq.ParquetFile(path, page_checksum_verification=True).read()
        meta = metadata(table)
    except FileNotFoundError:
        raise InputError("no such file", where=str(path), do="run cfem simulate-sample") from None
    except (OSError, ValueError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        do = "make it anew with cfem simulate-sample --force"
        raise InputError(f"is damaged: {reason}", where=str(path), do=do) from None
    if set(table.column_names) != {column.name for column in COLUMNS} or not {"format", "rows", "units"} <= set(meta):
        raise InputError("is no dataset of cfem: its columns or its metadata differ", where=str(path))
    if meta["format"] != FORMAT:
        raise InputError(f"has format {meta['format']}; this cfem reads {FORMAT}", where=str(path))
    return table


def column_array(table: pa.Table, name: str) -> np.ndarray:
    """(m,) or (m, size of the list) values of a column without nulls."""
    column = table[name].combine_chunks()
    if pa.types.is_fixed_size_list(column.type):
        return column.flatten().to_numpy(zero_copy_only=False).reshape(len(column), column.type.list_size)
    return column.to_numpy(zero_copy_only=False)
