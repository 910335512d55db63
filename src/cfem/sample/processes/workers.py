"""Who solves: processes of this machine, or the workers of a Dask cluster."""

from dataclasses import dataclass

from cfem.core.errors import NumericalError, SpecError


class WorkersLost(NumericalError):
    """A worker died, or none answers."""

    def __init__(self, what: str):
        do = "run again to go on from what is finished: fewer --workers where memory ran out, a longer --timeout or a "
        super().__init__(what, where="sample", do=do + "smaller `shard` where the work takes so long")


@dataclass(frozen=True)
class Workers:
    """Processes that solve rows."""

    count: int | None = None  # local processes, one a core by default
    scheduler: str | None = None  # address of a Dask scheduler whose workers solve instead
    timeout: float | None = None  # s without a finished shard after which all are given up

    def __post_init__(self) -> None:
        if self.count and self.scheduler:
            raise SpecError("--workers are local processes, and --scheduler has its own", do="leave one of them out")
