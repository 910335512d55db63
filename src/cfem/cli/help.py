"""Layout of `cfem --help`: the commands in the order of work, each with its whole summary, within 80 columns."""

import re
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

from cfem.core.errors import EXIT_CODES

GROUPS = {
    "Start": ("demo", "init", "run"),
    "One stage at a time": ("mesh", "sample", "merge", "train", "export", "control", "simulate", "report"),
    "Material, calibration, design": ("material", "calibrate", "optimize-design"),
    "Measured robots": ("estimate", "measurements", "calibrate-cases", "predict-cases"),
    "Look at results": ("summary", "animate", "inspect", "modes", "verify", "clean"),
    "Check the solver, help an editor": ("stability", "schema"),
}


class Commands(TyperGroup):
    """Group of all commands but the hidden ones, listed by their group."""

    def list_commands(self, ctx: typer.Context) -> list[str]:
        order = [name for names in GROUPS.values() for name in names]
        return sorted(self.commands, key=lambda name: order.index(name) if name in order else len(order))

    def format_commands(self, ctx: typer.Context, formatter: Any) -> None:
        shown = {name: self.commands[name] for name in self.list_commands(ctx) if not self.commands[name].hidden}
        rows = {name: _summary(command) for name, command in shown.items()}
        width = max(map(len, rows))
        for title, names in GROUPS.items():
            with formatter.section(title):
                formatter.write_dl([(f"{name:<{width}}", rows[name]) for name in names if name in rows])

    def format_epilog(self, ctx: typer.Context, formatter: Any) -> None:
        with formatter.section("Exit codes"):
            formatter.write_dl([(str(code), meaning) for code, meaning in EXIT_CODES.items()])


class App(typer.Typer):
    """Program whose commands show their help as `StageCommand` does."""

    def command(self, name: str | None = None, **options: Any) -> Any:
        return super().command(name, cls=StageCommand, **options)


class StageCommand(TyperCommand):
    """Command whose help says `cfem mesh SPEC`, `--out PATH`, `--count N` in place of `{spec}`, `<path>` and
    `<int range>`."""

    def collect_usage_pieces(self, ctx: typer.Context) -> list[str]:
        return [piece.strip("{}").replace("}", "").upper() for piece in super().collect_usage_pieces(ctx)]

    def format_options(self, ctx: typer.Context, formatter: Any) -> None:
        """Writes the arguments and options."""
        rows: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        for parameter in self.get_params(ctx):
            record = parameter.get_help_record(ctx)
            if record and parameter.param_type_name == "argument":
                rows["Arguments"].append(
                    (parameter.display_name_raw.upper(), record[1].removesuffix("[required]").rstrip())
                )
            elif record:
                rows["Options"].append((re.sub(r"<.*>", lambda type_: _VALUES[type_[0]], record[0]), record[1]))
        for title, entries in rows.items():
            if entries:
                with formatter.section(title):
                    formatter.write_dl(entries)

    def format_epilog(self, ctx: typer.Context, formatter: Any) -> None:
        """Writes what it reads and writes; the example on a line of its own, to be copied."""
        files, _, example = (self.epilog or "").partition("Example: ")
        if files:
            formatter.write_paragraph()
            with formatter.indentation():
                formatter.write_text(files.strip())
        if example:
            formatter.write(f"\nExample:\n  {example}\n")


_VALUES = {
    "<path>": "PATH",
    "<str>": "TEXT",
    "<list[str]>": "TEXT",
    "<list[Path]>": "PATH",
    "<float>": "NUMBER",
    "<float range>": "NUMBER",
    "<int>": "N",
    "<int range>": "N",
}


def _summary(command: Any) -> str:
    return " ".join((command.help or "").split("\n\n")[0].split())
