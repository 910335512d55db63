"""`cfem init`: asks on a terminal, says what it takes elsewhere."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cfem.cli.schemas import write_schemas
from cfem.core.console.terminal import printable
from cfem.core.errors import SpecError
from cfem.init.question import Answer, Ask, Question, answer


def init_scene(
    name: str,
    source: Path,
    folder: Path,
    given: Mapping[str, str | None],
    cables: Sequence[str],
    chambers: Sequence[str],
    force: bool,
    quiet: bool,
    as_json: bool,
) -> dict[str, Any] | str:
    """Scene of a new robot from a file with its shape. given: what options state, by name."""
    from cfem.init.create import create
    from cfem.init.drive import Stated

    for option, several, stated in (("cable", "cables", cables), ("chamber", "chambers", chambers)):
        if stated and given.get(several) is not None:
            raise SpecError(
                f"--{option} and --{several} exclude each other", do=f"state each {option}, or leave --{option} out"
            )
    flags = [flag for flag, text in given.items() if text is not None]
    typed: dict[str, str] = {}
    try:
        made = create(name, source, folder, _asking(given, quiet, typed), Stated(cables, chambers, flags), force)
    except BaseException:
        if typed:  # what a person has typed is not lost
            words = " ".join(f'--{flag} "{text}"' for flag, text in typed.items())
            print(printable(f"your answers, to go on with: {words}"), file=sys.stderr)
        raise
    write_schemas(folder.parent / "schemas", check=False)
    if as_json:
        return made
    mended = [f"mended {source.name}: {phrase}" for phrase in made["mended"]]
    questions = [f"open: what drives the robot? {sentence}" for sentence in made["open"]]
    first = "answer what is marked OPEN in" if questions else "look at"
    return "\n".join([*mended, _text(made, f"{first} {made['folder']}/scene.yaml, then "), *questions])


def init_robot(
    name: str, robot: str, folder: Path, stated: Sequence[str], force: bool, as_json: bool
) -> dict[str, Any] | str:
    """Copy of a robot that comes with cfem; stated: options that go with a shape only."""
    from cfem.pipeline.robots import copy_robot

    if stated:
        raise SpecError(f"--{stated[0]} goes with --from", where="--robot", do="edit the scene that is written")
    made = copy_robot(robot, name, folder, force)
    write_schemas(folder.parent / "schemas", check=False)
    return made if as_json else _text(made)


def _asking(given: Mapping[str, str | None], quiet: bool, typed: dict[str, str]) -> Ask:
    """Questioner that takes options first, then asks a person; typed: takes what a person answers, by flag."""

    def ask(question: Question) -> Answer:
        """Answer to a question, the guess where nobody is asked."""
        stated = given.get(question.flag)
        if stated is not None:
            return answer(question, stated)
        if is_terminal():
            return _from_terminal(question, typed)
        if not quiet:
            print(printable(f'--{question.flag} "{question.default}"    # guessed: {question.why}'), file=sys.stderr)
        return answer(question, None)

    return ask


def is_terminal() -> bool:
    """True if somebody can be asked."""
    return sys.stdin is not None and not sys.stdin.closed and sys.stdin.isatty()


def _from_terminal(question: Question, typed: dict[str, str]) -> Answer:
    """Asks until the answer makes sense; nothing typed is the default."""
    while True:
        asked = printable(f"{question.text}\n  [{question.default}: {question.why}] ")
        print(asked, end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            raise KeyboardInterrupt
        try:
            accepted = answer(question, line.strip() or None)
        except SpecError as error:
            print(printable(f"  {error}"), file=sys.stderr)
        else:
            if line.strip():
                typed[question.flag] = line.strip()
            return accepted


def _text(made: dict[str, Any], first: str = "") -> str:
    files = " ".join(file.removeprefix(f"{made['folder']}/") for file in made["files"])
    return f"made {made['folder']}: {files}\nnext: {first}cfem run {made['folder']}"
