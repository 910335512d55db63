"""What `cfem --help` looks like: the commands in the order of work, each with its whole summary, within 80 columns."""

from typing import Any

import typer
from typer.core import TyperGroup

from cfem.core.errors import EXIT_CODES

GROUPS = {
    "Start": ("demo", "init", "run"),
    "One stage at a time": ("mesh", "sample", "merge", "train", "export", "control", "simulate", "report"),
    "Which robot is it, which robot is best": ("material", "calibrate", "optimize-design"),
    "Robots that were measured": ("estimate", "measurements", "calibrate-cases", "predict-cases"),
    "Look at results": ("summary", "animate", "inspect", "modes", "verify"),
    "Check the solver, help an editor": ("stability", "schema"),
}


class Commands(TyperGroup):
    """Every command but the hidden ones, group by group."""

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


def _summary(command: Any) -> str:
    return " ".join((command.help or "").split("\n\n")[0].split())
