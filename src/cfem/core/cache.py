"""Cache of what a machine needs once: the user's cache folder, or a private temporary one."""

import os
import stat
import sys
import tempfile
from contextlib import suppress
from hashlib import sha256
from pathlib import Path


def cache_folder() -> Path | None:
    """A folder that this user may write to and nobody else; None where there is none.

    That of the user's caches (XDG_CACHE_HOME, LOCALAPPDATA on Windows), or else one of the temporary folder: what lies
    there is run, so it must be this user's own."""
    home = os.environ.get("LOCALAPPDATA") if sys.platform == "win32" else os.environ.get("XDG_CACHE_HOME")
    kept = Path(home) / "cfem" if home else Path(os.path.expanduser("~")) / ".cache" / "cfem"
    if is_writable(kept):
        return kept
    try:
        temporary = Path(tempfile.gettempdir()) / f"cfem-{os.getuid() if hasattr(os, 'getuid') else 'cache'}"
        temporary.mkdir(mode=0o700, exist_ok=True)
        return temporary if _is_private(temporary) and is_writable(temporary) else None
    except OSError:
        return None


def is_writable(folder: Path) -> bool:
    """True if files can be made in a folder, which is made where it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _is_private(folder: Path) -> bool:
    """True if it is a folder, no link, of this user alone. On Windows temporary folders are."""
    status = folder.lstat()
    if not hasattr(os, "getuid"):
        return stat.S_ISDIR(status.st_mode)
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077


def place_compiled_code(package: Path) -> None:
    """Tells numba, before its first use, where to keep the machine code of a package that cannot be written to.

    Code of other sources is removed. numba looks at the file of a function alone: after an upgrade that leaves it as it
    was, it would run with the functions and constants that it had from other files."""
    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    if is_writable(package / "__pycache__"):
        _forget_others(package, _sources(package))
        return
    folder = cache_folder()
    if folder is not None:
        place = str(folder / f"numba-{_sources(package.parent)[:16]}")  # one place for all packages beside it
        os.environ["NUMBA_CACHE_DIR"] = place
        if "numba" in sys.modules:  # which has read its environment
            sys.modules["numba"].config.CACHE_DIR = place


def _sources(folder: Path) -> str:
    """Hash of all files with compiled functions."""
    digest = sha256()
    for file in sorted(folder.rglob("*.py")):
        text = file.read_bytes()
        if b"njit" in text:
            digest.update(text)
    return digest.hexdigest()


def _forget_others(package: Path, sources: str) -> None:
    """Removes the machine code beside a package that was made of other sources."""
    stamp = package / "__pycache__" / "kernels.sha256"
    if stamp.exists() and stamp.read_text() == sources:
        return
    for file in package.rglob("__pycache__/*.nb[ic]"):
        with suppress(OSError):  # another process removes it too
            file.unlink()
    stamp.write_text(sources)
