"""One exception a documented exit code. A message says what is wrong, where, and what to do."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class CfemError(Exception):
    """Base of all errors: a defect of ours unless a subclass says otherwise (exit 1)."""

    exit_code = 1

    def __init__(self, what: str, *, where: str | None = None, do: str | None = None):
        self.what, self.where, self.do = what, _direct(where), do
        super().__init__(": ".join(part for part in (self.where, what) if part) + (f" ({do})" if do else ""))


def _direct(where: str | None) -> str | None:
    """'data/mesh' for 'pipelines/bar/../../data/mesh', unless links on the way make them differ."""
    if where is None or ".." not in where:
        return where
    direct = os.path.normpath(where)
    return direct if os.path.realpath(direct) == os.path.realpath(where) else where


class SpecError(CfemError):
    """Usage or spec: unknown key, wrong unit, a value out of range (exit 2)."""

    exit_code = 2


class InputError(CfemError):
    """An input file is missing, corrupt or incompatible (exit 3)."""

    exit_code = 3


@contextmanager
def located(path: Path) -> Iterator[None]:
    """Places an InputError that does not say where it is at this path."""
    try:
        yield
    except InputError as error:
        if error.where:
            raise
        raise type(error)(error.what, where=str(path), do=error.do) from None


class StaleError(InputError):
    """An input is not what its own command would make now (exit 3)."""


class NumericalError(CfemError):
    """A computation failed, or its result should not be trusted; what there is is kept (exit 4)."""

    exit_code = 4


class GateError(CfemError):
    """A stated figure is not met, or an output is stale under --check (exit 5)."""

    exit_code = 5


class OutputError(CfemError):
    """The output exists from other inputs, or another process holds it (exit 6)."""

    exit_code = 6


class DiskError(CfemError):
    """The disk is full or refuses to be written (exit 7)."""

    exit_code = 7


EXIT_CODES = {
    0: "done",
    1: "a defect of cfem",
    2: "wrong usage or spec",
    3: "an input file is missing, corrupt or incompatible",
    4: "numerical failure (what converged is kept), or a result that is contradicted or, with --strict, poor",
    5: "a stated figure is not met, or an output is stale under --check",
    6: "the output exists and is not replaced, or another process holds it",
    7: "disk full or not writable",
    130: "interrupted; finished stages, samples and goals are kept",
}
