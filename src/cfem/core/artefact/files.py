"""Files that are either whole or absent, and the hashes that name their content."""

import errno
import hashlib
import io
import json
import math
import os
import socket
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from cfem.core.errors import DiskError, InputError, OutputError, SpecError
from cfem.core.system import read_head, replace_content, sync, try_lock

# Why the system refuses to write, and what to do about it.
DISK = {
    **dict.fromkeys((errno.ENOSPC, errno.EDQUOT), "free space, or choose --out on another disk"),
    **dict.fromkeys((errno.EACCES, errno.EPERM), "choose --out in a folder that you may write to"),
    errno.EROFS: "the disk is read-only: choose --out on another",
    errno.EFBIG: "the file would be larger than this system allows",
    errno.EIO: "look at the disk, or choose --out on another",
}


@contextmanager
def disk_errors(path: Path) -> Iterator[None]:
    """Turns a disk's refusal to write into one sentence with its exit code."""
    try:
        yield
    except OSError as error:
        if error.errno in DISK:
            raise DiskError(f"cannot write: {error.strerror}", where=str(path), do=DISK[error.errno]) from error
        if error.errno in (errno.ENOTDIR, errno.EEXIST):
            what = "a file stands where a folder is needed"
            raise DiskError(what, where=error.filename or str(path), do="choose another --out") from error
        raise


_ROOT: ContextVar[Path | None] = ContextVar("root", default=None)


@contextmanager
def confined(folder: Path) -> Iterator[None]:
    """Confines `write_whole` to `folder` while it lasts, for names of a spec become names of files."""
    token = _ROOT.set(folder)
    try:
        yield
    finally:
        _ROOT.reset(token)


def write_whole(path: Path, data: bytes) -> None:
    """Temporary file, fsync, rename, fsync of the folder: a reader sees the old file or the new one, never a part."""
    root = _ROOT.get()
    if root is not None and not Path(os.path.abspath(path)).is_relative_to(os.path.abspath(root)):
        raise SpecError("this name would write a file outside the artefact", where=str(path), do="use plain names")
    with disk_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        try:
            with open(partial, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(partial, path)
        finally:
            partial.unlink(missing_ok=True)
        sync(path.parent)


def npz_bytes(arrays: Mapping[str, np.ndarray]) -> bytes:
    """An .npz file; equal arrays, equal bytes (np.savez stamps no time)."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def write_npz(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Whole or absent."""
    write_whole(path, npz_bytes(arrays))


def remove_unfinished(folder: Path) -> None:
    """Removes what a process that was killed in the middle of `write_whole` left behind."""
    for path in folder.rglob(".*.tmp"):
        path.unlink(missing_ok=True)


def sync_tree(folder: Path) -> None:
    """Syncs a folder and all in it to the disk, whoever wrote it."""
    with disk_errors(folder):
        for path in [*folder.rglob("*"), folder]:
            sync(path)


@contextmanager
def open_regular(path: Path) -> Iterator[BinaryIO]:
    """The file's bytes; InputError where it cannot be read, or is no regular file: a device or a pipe may never end."""
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise InputError("is not a file", where=str(path), do="check the path")
        with open(path, "rb") as file:
            yield file
    except FileNotFoundError:
        raise InputError("no such file", where=str(path), do="check the path, or run the stage that makes it") from None
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(path), do="check its permissions") from error


def file_sha256(path: Path) -> str:
    """Hex digest of a file's bytes; InputError where it cannot be read."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def content_sha256(value: Any) -> str:
    """Hex digest of plain data and arrays: equal values, equal digest, whatever their spelling."""
    return hashlib.sha256(json.dumps(plain(value), sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def plain(value: Any) -> Any:
    """Plain data as JSON knows it, of arrays, paths, tuples and numpy numbers. Floats keep all their digits."""
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def finite(value: float | None) -> float | None:
    """The number, None where it is missing or not finite, which JSON does not hold."""
    return value if value is not None and math.isfinite(value) else None


def read_json(path: Path) -> dict:
    """A JSON object; InputError where the file is missing or damaged."""
    try:
        with open_regular(path) as file:
            data = parse_json(file.read())
    except (ValueError, RecursionError) as error:
        raise InputError(f"is damaged: {error}", where=str(path), do="regenerate it with --force") from error
    if not isinstance(data, dict):
        raise InputError("is damaged: not a JSON object", where=str(path), do="regenerate it with --force")
    return data


def parse_json(text: bytes) -> Any:
    """Data of a JSON text. ValueError for anything but JSON, of which NaN and numbers beyond the largest are none."""
    return json.loads(text, parse_constant=_refuse, parse_float=_finite)


def _refuse(text: str) -> Any:
    raise ValueError(f"{text} is no number")


def _finite(text: str) -> float:
    number = float(text)
    return number if math.isfinite(number) else _refuse(text)


def write_json(path: Path, data: dict) -> None:
    write_whole(path, (json.dumps(plain(data), indent=2, allow_nan=False) + "\n").encode())


@contextmanager
def locked(target: Path) -> Iterator[None]:
    """Locks `target` for one writer: a lock of the operating system, which ends with the process that holds it, however
    it ends. OutputError, naming who writes, where it is held."""
    lock = target.with_name(f".{target.name}.lock")
    with disk_errors(lock):
        lock.parent.mkdir(parents=True, exist_ok=True)
        refuse_link(lock)
        handle = os.open(lock, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
    try:
        try:
            acquired = try_lock(handle)
        except OSError as error:
            raise DiskError(f"cannot be locked: {error.strerror}", where=str(lock), do="choose --out") from error
        if not acquired:
            who = read_head(handle).decode(errors="replace").strip()
            what = f"another process is writing here{f' ({who})' if who else ''}"
            raise OutputError(what, where=str(target), do="wait for it to end")
        with disk_errors(lock):
            replace_content(handle, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
        yield
    finally:
        os.close(handle)


def refuse_link(path: Path) -> None:
    """Raises OutputError where a link stands at the name of one of our own files: what it points to is not ours."""
    if path.is_symlink():
        raise OutputError("is a symbolic link; cfem writes its own file here", where=str(path), do="remove the link")
