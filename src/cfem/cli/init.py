"""`cfem init`: asks on a terminal, says what it takes elsewhere."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cfem.cli.schemas import write_schemas
from cfem.core.errors import SpecError
from cfem.core.terminal import printable
from cfem.init.question import Answer, Ask, Question, answer


def init_scene(
    name: str,
    source: Path,
    folder: Path,
    given: Mapping[str, str | None],
    cables: Sequence[str],
    force: bool,
    quiet: bool,
    as_json: bool,
) -> dict[str, Any] | str:
    """given: what options say, by name."""
    from cfem.init.create import create

    if cables and given.get("cables") is not None:
        raise SpecError("--cable and --cables exclude each other", do="state each cable, or how many to place")
    stated = [flag for flag, said in given.items() if said is not None]
    made = create(name, source, folder, cables, _asking(given, quiet), stated, force)
    write_schemas(folder.parent / "schemas", check=False)
    return made if as_json else _text(made, f"look at {made['folder']}/scene.yaml, then ")


def init_robot(
    name: str, robot: str, folder: Path, stated: Sequence[str], force: bool, as_json: bool
) -> dict[str, Any] | str:
    """Of the robots that come with cfem; stated: options that go with a shape only."""
    from cfem.pipeline.robots import copy_robot

    if stated:
        raise SpecError(f"--{stated[0]} goes with --from", where="--robot", do="edit the scene that is written")
    made = copy_robot(robot, name, folder, force)
    write_schemas(folder.parent / "schemas", check=False)
    return made if as_json else _text(made)


def _asking(given: Mapping[str, str | None], quiet: bool) -> Ask:
    def ask(question: Question) -> Answer:
        said = given.get(question.flag)
        if said is not None:
            return answer(question, said)
        if is_terminal():
            return _from_terminal(question)
        if not quiet:
            print(printable(f'--{question.flag} "{question.default}"    # guessed: {question.why}'), file=sys.stderr)
        return answer(question, None)

    return ask


def is_terminal() -> bool:
    """Whether somebody can be asked."""
    return sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty()


def _from_terminal(question: Question) -> Answer:
    """Asks until the answer makes sense; nothing typed is the default."""
    while True:
        asked = printable(f"{question.text}\n  [{question.default}: {question.why}] ")
        print(asked, end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            raise KeyboardInterrupt
        try:
            return answer(question, line.strip() or None)
        except SpecError as error:
            print(printable(f"  {error}"), file=sys.stderr)


def _text(made: dict[str, Any], first: str = "") -> str:
    files = " ".join(file.removeprefix(f"{made['folder']}/") for file in made["files"])
    return f"made {made['folder']}: {files}\nnext: {first}cfem run {made['folder']}"
