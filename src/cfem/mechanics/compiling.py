"""Says so where numba compiles a kernel: the first use of one in an installation takes seconds."""

from typing import Any

from numba.core import event

from cfem.core.console.progress import doing, what_is_done


class _CompilationNotice(event.Listener):
    def __init__(self) -> None:
        self._before: list[str] = []

    def on_start(self, event: Any) -> None:
        self._before.append(what_is_done())
        doing("compiling kernels, once per installation")

    def on_end(self, event: Any) -> None:
        doing(self._before.pop())


event.register("numba:compile", _CompilationNotice())
