"""From a stage's outcome to what a person or a program reads, and to the documented exit code."""

import json
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NoReturn

from cfem.core.artefact.files import DISK
from cfem.core.artefact.judgement import demand_trust, sentences
from cfem.core.console.progress import shown
from cfem.core.console.shown import duration
from cfem.core.console.terminal import printable
from cfem.core.errors import CfemError
from cfem.core.interrupts import ENDS
from cfem.core.optional import explained
from cfem.core.stage import Options

LONGEST = 2000  # characters of an error


def run_command(
    work: Callable[[Options], dict[str, Any] | str],
    force: bool = False,
    check: bool = False,
    as_json: bool = False,
    quiet: bool = False,
    strict: bool = False,
    label: str = "",
    interrupted: str = "finished stages, samples and goals are kept: run the same command again",
) -> None:
    """Calls `work`, prints its manifest or text to stdout, its errors as one line to stderr, and exits on error; after
    printing where the results are contradicted or, if `strict`, poor.

    label: of the command, under which progress is shown; without one nothing is shown
    interrupted: what an interruption leaves"""
    came: list[int] = []
    working = True

    def interrupt(number: int, frame: Any) -> None:
        if working:  # after that, what is left is to say how it ended
            came.append(number)
            raise KeyboardInterrupt

    for number in ENDS:
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, interrupt)
    try:
        try:
            with shown(label, quiet or as_json or not label):
                outcome = work(Options(force=force, check=check, quiet=quiet or as_json))
        except Exception:
            if came:  # compiled code makes other errors of an interrupt
                raise KeyboardInterrupt from None
            raise
        finally:
            working = False
    except CfemError as error:
        _fail(str(error), error.exit_code)
    except ImportError as error:
        if (missing := explained(error)) is None:
            _defect(error)
        _fail(str(missing), missing.exit_code)
    except KeyboardInterrupt:
        _fail(f"interrupted; {interrupted}", 130)
    except BrokenPipeError:
        sys.exit(1)
    except OSError as error:
        _file_error(error)
    except MemoryError:
        _fail("out of memory (make the problem smaller, or use fewer --workers)", 4)
    except Exception as error:
        _defect(error)
    else:
        with stdout_errors():
            print(_json(outcome) if as_json else printable(_text(outcome)), flush=True)
        try:
            demand_trust(outcome.get("results", {}) if isinstance(outcome, dict) else {}, strict)
        except CfemError as error:
            _fail(str(error), error.exit_code)


def _file_error(error: OSError) -> NoReturn:
    """One sentence and exit 7 for a disk that fails, 3 for a file that cannot be read."""
    if os.environ.get("CFEM_DEBUG"):
        raise error
    if error.errno in DISK:
        _fail(f"{error.filename or 'a file'}: {error.strerror} (look at its disk and permissions)", 7)
    _fail(f"{error.filename or 'a file'}: cannot be read: {error.strerror or error}", 3)


@contextmanager
def stdout_errors() -> Iterator[None]:
    """Handles errors of stdout within: a full disk, one sentence and exit 7, or a reader that has gone, exit 1."""
    try:
        yield
        sys.stdout.flush()
    except OSError as error:
        if os.environ.get("CFEM_DEBUG"):
            raise
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - what is left in the buffer has nowhere to go
        if isinstance(error, BrokenPipeError):
            sys.exit(1)
        _fail(f"stdout: cannot write: {error.strerror} (the work is done; only its summary could not be printed)", 7)


def _defect(error: Exception) -> NoReturn:
    if os.environ.get("CFEM_DEBUG"):
        raise error
    _fail(f"a defect of cfem: {type(error).__name__}: {error}; please report it (CFEM_DEBUG=1 shows where)", 1)


def _fail(message: str, code: int) -> NoReturn:
    """Exits with one line, whatever a spec or a file made of it."""
    line = printable(" ".join(message.splitlines()))
    with suppress(OSError):  # nobody can be told
        print(f"cfem: {line if len(line) <= LONGEST else line[:LONGEST] + ' ...'}", file=sys.stderr)
    sys.exit(code)


def _json(outcome: dict[str, Any] | str) -> str:
    from cfem.core.artefact.files import plain

    keys = ("stage", "status", "made_from", "content", "results", "seconds")
    if isinstance(outcome, dict) and "results" in outcome:
        outcome = {key: outcome[key] for key in keys if key in outcome}
    return json.dumps(plain(outcome) if isinstance(outcome, dict) else {"text": outcome}, allow_nan=False)


def _text(outcome: dict[str, Any] | str) -> str:
    if isinstance(outcome, str):
        return outcome
    from cfem.cli.inspect import figures

    took = "" if outcome["status"] == "up to date" else f" in {duration(outcome['seconds'])}"
    status = f"{outcome['stage']}: {outcome['status']}{took}"
    return "\n".join([*sentences(outcome["results"]), status, *figures(outcome["results"])])
