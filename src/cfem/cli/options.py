"""Arguments and options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

Spec = Annotated[Path, typer.Argument(help="YAML file of the stage.")]
Set = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY.SUB=VALUE", help="Replace a value of the YAML file for this run."),
]
Out = Annotated[Path | None, typer.Option("--out", help="Output folder, in place of `out` in the YAML file.")]
Force = Annotated[bool, typer.Option("--force", help="Run even if nothing has changed, and replace the output.")]
MoveAside = Annotated[
    bool,
    typer.Option(
        "--force", help="Move samples and hardware runs of other inputs aside. What is up to date is not run again."
    ),
]
Check = Annotated[bool, typer.Option("--check", help="Run nothing. Exit with 5 if the output is not up to date.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit with 4 if a result is poor, that is, not to be trusted.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object instead of text.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Show no progress.")]
Workers = Annotated[
    int | None, typer.Option("--workers", min=1, help="How many processes solve. Default: one per core.")
]
