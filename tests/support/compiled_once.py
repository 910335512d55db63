"""What the suite compiles, once for all its processes: kernels of numba, and objects of C."""

import os
import re
import shutil
from collections.abc import Callable
from contextlib import contextmanager, nullcontext
from hashlib import sha256
from pathlib import Path
from unittest.mock import patch

from cfem.export.compiled import build


@contextmanager
def compiled_once(shared: Path):
    """A context in which processes with the same folder `shared` do not compile what one of them has."""
    objects = shared / "objects"
    objects.mkdir(exist_ok=True)
    with patch.object(build, "objects", kept(build.objects, objects)), kernels_in_turn(shared):
        yield


def kept(compile: Callable, kept_in: Path) -> Callable:
    """`build.objects` that takes an object from a folder where the same command has made it of the same text."""

    def objects(command, folder, names, place):
        names = [str(name) for name in names]
        keys = [sha256("\n".join([*command, name, text_of(folder / name)]).encode()).hexdigest() for name in names]
        missing = [name for name, key in zip(names, keys, strict=True) if not (kept_in / key).exists()]
        made = dict(zip(missing, compile(command, folder, missing, place), strict=True)) if missing else {}
        found = []
        for name, key in zip(names, keys, strict=True):
            if name in made:
                partial = kept_in / f"{key}.{os.getpid()}"
                shutil.copyfile(made[name], partial)
                partial.replace(kept_in / key)
            else:
                shutil.copyfile(kept_in / key, place / f"{Path(name).stem}.o")
            found.append(place / f"{Path(name).stem}.o")
        return found

    return objects


def text_of(path: Path, read: set[Path] | None = None) -> str:
    """Text of a source and, once each, of the headers of its folder that it includes, and they include."""
    read = set() if read is None else read
    text = path.read_text(encoding="utf-8")
    headers = [path.parent / name for name in re.findall(r'^\s*#\s*include\s+"(.+?)"', text, re.MULTILINE)]
    for header in headers:
        if header not in read and header.exists():
            read.add(header)
            text += text_of(header, read)
    return text


def kernels_in_turn(shared: Path):
    """A context in which one process at a time compiles a kernel, and the others load what it has stored."""
    if "PYTEST_XDIST_WORKER" not in os.environ:  # there are no others
        return nullcontext()
    try:
        from fcntl import LOCK_EX, flock
    except ImportError:  # Windows
        return nullcontext()
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    compile, compiling = Dispatcher.compile, set()

    def in_turn(self, signature):
        stored = getattr(self._cache, "cache_path", None)
        key = sha256(f"{stored} {self.__module__} {self.__qualname__}".encode()).hexdigest()
        if stored is None or key in compiling:
            return compile(self, signature)
        with global_compiler_lock, open(shared / f"{key}.lock", "w") as lock:  # as `compile` does, lest threads wait
            flock(lock, LOCK_EX)  # for each other; one kernel waits only for those that it calls
            compiling.add(key)
            try:
                return compile(self, signature)
            finally:
                compiling.discard(key)

    return patch.object(Dispatcher, "compile", in_turn)
