"""Parquet files of others: what they claim is compared with their size before anything is read."""

import os
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from cfem.core.artefact.files import open_regular
from cfem.core.errors import InputError

ROW_BYTES = 4  # a row of floating-point numbers takes more, however well it is compressed
RATIO, FREE = 100, 2**26  # uncompressed bytes, of each on disk and in any case


def open_parquet(path: Path | pa.NativeFile, do: str) -> pq.ParquetFile:
    """The file on this or (opened) on another machine, not read yet, its page checksums to be verified. InputError
    where it is none, or claims to hold more than a file of its size can."""
    size = path.size() if isinstance(path, pa.NativeFile) else _size(path)
    try:
        file = pq.ParquetFile(path, page_checksum_verification=True)
    except (OSError, ValueError, pa.ArrowException) as error:
        raise damaged(path, error, do) from None
    meta = file.metadata
    large = sum(meta.row_group(i).total_byte_size for i in range(meta.num_row_groups))
    if meta.num_rows * ROW_BYTES > size or large > RATIO * size + FREE:
        what = f"is damaged: it claims {meta.num_rows} rows of {large} bytes, in a file of {size} bytes"
        raise InputError(what, where=str(path), do=do)
    return file


def read_parquet(path: Path, columns: Sequence[str] | None = None, do: str = "regenerate it with --force") -> pa.Table:
    """The whole file, or some of its columns. InputError where it is damaged."""
    file = open_parquet(path, do)
    try:
        return file.read(columns=None if columns is None else list(columns))
    except (OSError, ValueError, MemoryError, pa.ArrowException) as error:
        raise damaged(path, error, do) from None


def _size(path: Path) -> int:
    with open_regular(path) as file:
        return os.fstat(file.fileno()).st_size


def damaged(path: Path | pa.NativeFile, error: BaseException, do: str) -> InputError:
    reason = next(iter(str(error).splitlines()), type(error).__name__)
    return InputError(f"is damaged: {reason[:300]}", where=str(path), do=do)
