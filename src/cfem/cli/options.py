"""Arguments and options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

Spec = Annotated[Path, typer.Argument(help="The stage's YAML spec.")]
Set = Annotated[list[str] | None, typer.Option("--set", metavar="KEY.SUB=VALUE", help="Override a value of the spec.")]
Out = Annotated[Path | None, typer.Option("--out", help="Output folder, instead of the spec's.")]
Force = Annotated[bool, typer.Option("--force", help="Run even if up to date, and replace what is there.")]
Check = Annotated[bool, typer.Option("--check", help="Run nothing; exit 5 if the output is stale.")]
Strict = Annotated[bool, typer.Option("--strict", help="Exit 4 where the result is poor: nobody should trust it.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="No progress.")]
Workers = Annotated[int | None, typer.Option("--workers", min=1, help="Local processes. Default: one per core.")]
