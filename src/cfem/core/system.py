"""Differences between Linux, macOS and Windows: locks, syncing, cores, memory."""

import ctypes
import os
import platform
import sys
from contextlib import suppress
from pathlib import Path

_LOCKED_BYTE = 1 << 30  # on Windows a locked byte cannot be read by others: one beyond the text of the file


def try_lock(handle: int) -> bool:
    """Locks an open file for this process until the handle is closed; False where another process holds it.

    The operating system ends the lock with the process, however it ends. OSError where the disk has no locks."""
    try:
        import fcntl
    except ImportError:
        return _try_lock_on_windows(handle)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _try_lock_on_windows(handle: int) -> bool:
    """Locks a byte of an open file and returns True; False where another process holds it."""
    import msvcrt

    os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
    try:
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    except PermissionError:
        return False
    return True


def read_head(handle: int) -> bytes:
    """The first 200 bytes of an open file."""
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 200)


def replace_content(handle: int, data: bytes) -> None:
    """Makes `data` all that an open file holds."""
    os.truncate(handle, 0)
    os.lseek(handle, 0, os.SEEK_SET)
    os.write(handle, data)


def sync(path: str | os.PathLike) -> None:
    """Makes a file's bytes, or the renames inside a folder, survive a power cut. Windows cannot sync a folder."""
    windows = sys.platform == "win32"
    if windows and os.path.isdir(path):
        return
    handle = os.open(path, os.O_RDWR if windows else os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def exchange(first: str | os.PathLike, second: str | os.PathLike) -> bool:
    """Swaps two folders in one step, so that each name leads to a whole folder at any moment. False where the system or
    the disk cannot."""
    libc = ctypes.CDLL(None, use_errno=True) if sys.platform in ("linux", "darwin") else None
    names, working_folder = [os.fsencode(first), os.fsencode(second)], -100  # AT_FDCWD
    if sys.platform == "linux" and hasattr(libc, "renameat2"):
        return libc.renameat2(working_folder, names[0], working_folder, names[1], 2) == 0  # RENAME_EXCHANGE
    if sys.platform == "darwin" and hasattr(libc, "renamex_np"):
        return libc.renamex_np(*names, 2) == 0  # RENAME_SWAP
    return False


def processor() -> str:
    """Maker and model of the processor, as far as the system says."""
    with suppress(OSError):
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0].splitlines()
        facts = dict(line.split(":", 1) for line in lines if ":" in line)
        named = [value.strip() for key, value in facts.items() if key.strip() in ("vendor_id", "model name")]
        if named:
            return " ".join(named)
    return platform.processor() or platform.machine()


def cores() -> int:
    """Number of cores that this process may use, where the system says so; otherwise of those that there are."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def peak_memory() -> float | None:
    """GiB that this process has held at most; None where the system does not say."""
    try:
        import resource
    except ImportError:
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 2**30
