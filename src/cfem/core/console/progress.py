"""Progress of a command on stderr, so that none is silent.

`shown` opens the display once a command. Work below it says what it does by `doing` and how far it is by `progress`,
and neither knows nor asks whether anybody looks: without a display both do nothing. On a terminal one line is rewritten
all the time. Elsewhere a line is printed after two seconds, every five seconds from then on, and less often the longer
the command runs: logs of long runs stay short."""

import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from cfem.core.console.terminal import printable

FIRST, EVERY = 2.0, 5.0  # s: to the first line, and from line to line, where there is no terminal
SHARE, MOST = 0.1, 60.0  # of the time so far, and s: from line to line later on
EVENTS = 3  # counted before the time left is estimated
SPINNER = "⠋⠙⠹⠸⠼⠴⠦⠧⠇⠏"


@dataclass
class Counted:
    """Work of `total` parts, of which `count` are done. poll: gives how many are done since it began, instead of calls
    of `advance`; note: what its line says beside. events: (time, count) of the first part that was done and of the
    latest."""

    total: int
    count: int
    estimate: bool
    poll: Callable[[], int] | None = None
    note: Callable[[], str] | None = None
    seen: int = 0
    first: tuple[float, int] = (0.0, 0)
    latest: tuple[float, int] = (0.0, 0)
    begun: int = field(init=False)

    def __post_init__(self) -> None:
        self.begun = self.count

    def advance(self, n: int, now: float) -> None:
        """Counts n parts more as done."""
        if n <= 0:
            return
        self.count = min(self.count + n, self.total)
        self.latest = (now, self.count)
        self.first = self.first if self.seen else self.latest
        self.seen += 1

    def look(self, now: float) -> None:
        """Counts what `poll` says is done."""
        if self.poll is not None:
            self.advance(self.begun + self.poll() - self.count, now)

    def left(self, now: float) -> float | None:
        """Time left in s, by the pace from the first part on, which alone may hold compilation and the like; None where
        too little is known."""
        (t0, n0), (t1, n1) = self.first, self.latest
        if not self.estimate or self.seen < EVENTS or n1 == n0:
            return None
        return max((t1 - t0) / (n1 - n0) * (self.total - n1) - (now - t1), 0.0)


class Display:
    """A line of text on the terminal that says what is being done.

    write: takes what is to be printed; clock: s; width: characters of a line that is rewritten, 0 to print lines."""

    def __init__(self, label: str, write: Callable[[str], object], clock: Callable[[], float], width: int = 0):
        self.label, self.text = label, ""
        self.counted: list[Counted] = []
        self.waiting = False  # for a person, whose answer no line may disturb
        self._write, self._clock, self._width = write, clock, width
        self.begin = clock()
        self._start, self._next, self._turn = self.begin, self.begin + FIRST, 0
        self.lock = threading.RLock()

    def tick(self) -> None:
        """Writes where it is time to; called often."""
        with self.lock:
            now = self._clock()
            for counted in self.counted:
                counted.look(now)
            if self.waiting:
                self._next = now + FIRST
            elif self._width:
                self._turn += 1
                line = f"{SPINNER[self._turn % len(SPINNER)]} {self.line()}"
                self._write(f"\r\x1b[K{line[: self._width - 1]}")
            elif now >= self._next:
                self._next = now + min(max(EVERY, SHARE * (now - self._start)), MOST)
                self._write(f"{self.line()}\n")

    def line(self) -> str:
        """'control: solving the goals by FE, 4/24, 12 s, about 30 s left'."""
        now = self._clock()
        parts = [f"{self.label}: {self.text or 'working'}"]
        remaining = None
        if self.counted:
            inner = self.counted[-1]
            parts.append(f"{inner.count}/{inner.total}")
            note = "" if inner.note is None else inner.note()
            parts += [note] if note else []
            remaining = inner.left(now)
        parts.append(f"{now - self.begin:.0f} s so far")
        if remaining is not None and remaining >= 1:
            parts.append(f"about {remaining:.0f} s left")
        return printable(", ".join(parts))

    def relabel(self, label: str) -> tuple[str, str, float]:
        """Work of its own begins. Returns label, text and beginning of what goes on after it."""
        before = (self.label, self.text, self.begin)
        self.label, self.text, self.begin = label, "", self._clock()
        return before

    def advance(self, counted: Counted, n: int) -> None:
        """Counts n parts more as done."""
        with self.lock:
            counted.advance(n, self._clock())

    def say(self, text: str) -> None:
        """Prints a line that stays."""
        text = printable(text)
        with self.lock:
            self._write(f"\r\x1b[K{text}\n" if self._width else f"{text}\n")

    def clear(self) -> None:
        """Leaves no line that is half written."""
        if self._width:
            self._write("\r\x1b[K")


_display: Display | None = None


@contextmanager
def shown(label: str, quiet: bool = False) -> Iterator[None]:
    """Shows what runs within on stderr, by the label of its command; within another, only the label changes."""
    global _display
    if quiet or _display is not None:
        with labelled(label):
            yield
        return
    terminal = sys.stderr.isatty()
    width = shutil.get_terminal_size().columns if terminal else 0
    display = _display = Display(label, _to_stderr, time.monotonic, width)
    ended = threading.Event()
    thread = threading.Thread(target=_keep_ticking, args=(display, ended, 0.1 if terminal else 0.5), daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        _display = None
        display.clear()


def _keep_ticking(display: Display, ended: threading.Event, seconds: float) -> None:
    while not ended.wait(seconds):
        display.tick()


def _to_stderr(text: str) -> None:
    try:
        sys.stderr.write(text)
        sys.stderr.flush()
    except (OSError, ValueError):
        pass  # nobody reads progress any more, and the work goes on without


@contextmanager
def labelled(label: str) -> Iterator[None]:
    """Begins all lines with this label while it lasts."""
    display = _display
    if display is None:
        yield
        return
    before = display.relabel(label)
    try:
        yield
    finally:
        display.label, display.text, display.begin = before


@contextmanager
def waiting() -> Iterator[None]:
    """Shows nothing while a person is asked."""
    display = _display
    if display is None:
        yield
        return
    with display.lock:
        display.waiting = True
        display.clear()
    try:
        yield
    finally:
        display.waiting = False


def doing(text: str) -> None:
    """States what is being done from now on."""
    if _display is not None:
        _display.text = text


def what_is_done() -> str:
    """The text of the last `doing`."""
    return "" if _display is None else _display.text


def say(text: str) -> None:
    """Prints a line to stderr, whether anything is shown or not."""
    if _display is None:
        print(printable(text), file=sys.stderr, flush=True)
    else:
        _display.say(text)


@contextmanager
def progress(
    what: str,
    total: int,
    *,
    done: int = 0,
    poll: Callable[[], int] | None = None,
    estimate: bool = True,
    note: Callable[[], str] | None = None,
) -> Iterator[Callable[[int], None]]:
    """Shows that `what` is being done, in `total` parts. Yields `advance(n)`, to be called when n parts more are done.

    done: parts that an earlier run finished, which do not enter the estimate of the time left
    estimate: False where more work of another kind follows
    poll: gives how many were done since, where another process counts them
    note: gives what the line says of the parts that are done, as what they cost"""
    display = _display
    if display is None or total <= done:
        yield lambda n: None
        return
    counted = Counted(total, done, estimate, poll, note)
    before, display.text = display.text, what
    display.counted.append(counted)
    try:
        yield lambda n: display.advance(counted, n)
    finally:
        display.counted.remove(counted)
        display.text = before
