"""`cfem init`: asks on a terminal, says what it takes elsewhere."""

import shlex
import shutil
import stat
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cfem.cli.schemas import write_schemas
from cfem.core.console.progress import say, waiting
from cfem.core.console.terminal import printable
from cfem.core.errors import SpecError
from cfem.core.optional import installed, remedy
from cfem.init.question import Answer, Ask, Question, answer

if TYPE_CHECKING:
    from cfem.init.body.shape import Shape
    from cfem.init.texts import NewScene

_PAGES, _LATEST = "cfem-init-", 5


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
    from cfem.init.create import Show, create
    from cfem.init.drive import Stated

    for option, several, stated in (("cable", "cables", cables), ("chamber", "chambers", chambers)):
        if stated and given.get(several) is not None:
            raise SpecError(
                f"--{option} and --{several} exclude each other", do=f"state each {option}, or leave --{option} out"
            )
    flags = [flag for flag, text in given.items() if text is not None]
    typed: dict[str, str] = {}
    guessed: set[str] = set()
    show = None if quiet else Show(_guessing(given, guessed), lambda *scene: _show(*scene) if guessed else None)
    try:
        stated = Stated(cables, chambers, flags)
        made = create(name, source, folder, _asking(given, quiet, typed), stated, force, show)
    except BaseException:
        if typed:  # what a person has typed is not lost
            words = _words(name, source, folder, {**given, **typed}, cables, chambers, force)
            say(f"your answers, to go on with: {words}")
        raise
    write_schemas(folder.parent / "schemas", check=False)
    if as_json:
        return made
    mended = [f"mended {source.name}: {phrase}" for phrase in made["mended"]]
    questions = [f"open: what drives the robot? {sentence}" for sentence in made["open"]]
    first = "answer what is marked OPEN in" if questions else "look at"
    text = _text(made, f"{first} {made['folder']}/scene.yaml, then ")
    return "\n".join([*mended, text, *made["fewer"], *made["doubts"], *questions])


def _words(
    name: str,
    source: Path,
    folder: Path,
    answers: Mapping[str, str | None],
    cables: Sequence[str],
    chambers: Sequence[str],
    force: bool,
) -> str:
    """Command line that repeats all answers."""
    words = ["cfem", "init", name, "--from", str(source), "--folder", str(folder)]
    for flag, text in (
        *answers.items(),
        *(("cable", text) for text in cables),
        *(("chamber", text) for text in chambers),
    ):
        if text is not None:
            words += [f"--{flag}={text}"] if text.startswith("-") else [f"--{flag}", text]
    return shlex.join([*words, *(["--force"] if force else [])])


def _show(robot: "NewScene", shape: "Shape") -> None:
    """Says where a page is that shows what is suggested, where what draws it is installed."""
    if not installed("matplotlib"):
        say(f"no picture of what is suggested: {remedy('matplotlib')}")
        return
    from cfem.report.suggestion import suggestion

    path = page_folder() / f"{robot.name}.html"
    path.write_text(suggestion(robot, shape), encoding="utf-8")
    say(f"what is suggested, to look at: {path}")


def page_folder() -> Path:
    """New temporary folder for a page. Of those that this user has, the latest stay: one may still be looked at."""
    new = Path(tempfile.mkdtemp(prefix=_PAGES))
    user, older = new.lstat().st_uid, []
    for path in {*new.parent.glob(f"{_PAGES}*")} - {new}:
        with suppress(OSError):  # another `cfem init` removes it too
            status = path.lstat()
            if stat.S_ISDIR(status.st_mode) and status.st_uid == user:
                older.append((status.st_mtime, path))
    for _, path in sorted(older, reverse=True)[_LATEST - 1 :]:
        shutil.rmtree(path, ignore_errors=True)
    return new


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


def _guessing(given: Mapping[str, str | None], guessed: set[str]) -> Ask:
    """Answers questions by options and defaults; guessed: takes the flags of which the default was taken."""

    def ask(question: Question) -> Answer:
        if given.get(question.flag) is None:
            guessed.add(question.flag)
        return answer(question, given.get(question.flag))

    return ask


def _asking(given: Mapping[str, str | None], quiet: bool, typed: dict[str, str]) -> Ask:
    """Questioner that takes options first, then asks a person; typed: takes what a person answers, by flag."""

    def ask(question: Question) -> Answer:
        """Answer to a question, the guess where nobody is asked."""
        stated = given.get(question.flag)
        if stated is not None:
            return answer(question, stated)
        if is_terminal():
            with waiting():
                return _from_terminal(question, typed)
        if not quiet:
            say(f'--{question.flag} "{question.default}"    # guessed: {question.why}')
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


def _text(result: dict[str, Any], first: str = "") -> str:
    files = " ".join(file.removeprefix(f"{result['folder']}/") for file in result["files"])
    return f"made {result['folder']}: {files}\nnext: {first}cfem run {result['folder']}"
