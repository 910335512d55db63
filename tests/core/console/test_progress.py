import threading

import pytest

from cfem.core.console import progress as module
from cfem.core.console.progress import EVERY, FIRST, Counted, Display, doing, progress, shown, waiting


class Clock:
    """Moves when it is told to."""

    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def written():
    return []


@pytest.fixture
def display(clock, written, monkeypatch):
    found = Display("solve", written.append, clock)
    monkeypatch.setattr(module, "_display", found)
    return found


def wait(display, clock, seconds, step=0.5):
    """As the thread of the display does."""
    for _ in range(round(seconds / step)):
        clock.now += step
        display.tick()


def test_a_line_after_two_seconds_and_every_five_from_then_on(display, clock, written):
    wait(display, clock, FIRST - 0.5)
    assert written == []
    wait(display, clock, 0.5)
    assert written == ["solve: working, 2 s so far\n"]
    wait(display, clock, 10 * EVERY)
    assert len(written) == 11


def test_a_long_run_has_a_line_a_minute(display, clock, written):
    wait(display, clock, 3600)
    assert len(written) < 90
    before = len(written)
    wait(display, clock, 600)
    assert len(written) == before + 10


def test_no_line_disturbs_a_person_who_is_asked(display, clock, written):
    wait(display, clock, FIRST)
    with waiting():
        wait(display, clock, 10 * EVERY)
        assert len(written) == 1
    wait(display, clock, FIRST - 0.5)
    assert len(written) == 1
    wait(display, clock, EVERY)
    assert len(written) == 2


def test_work_that_says_nothing_is_still_shown(display, clock, written):
    doing("compiling kernels")
    wait(display, clock, 60)
    assert len(written) == 12 and all("compiling kernels" in line for line in written)


def test_lines_say_what_is_done_and_how_far_it_is(display, clock):
    with progress("skeleton", 16) as advance:
        advance(3)
        assert display.line() == "solve: skeleton, 3/16, 0 s so far"
        with progress("contacts", 2):
            assert display.line() == "solve: contacts, 0/2, 0 s so far"
        assert "skeleton, 3/16" in display.line()
    assert display.line() == "solve: working, 0 s so far"


def test_no_estimate_before_three_events_and_none_of_the_first(clock):
    one = Counted(10, 0, True)
    for seconds in (300.0, 2.0):  # the first compiles
        clock.now += seconds
        one.advance(1, clock.now)
        assert one.left(clock.now) is None
    clock.now += 2.0
    one.advance(1, clock.now)
    assert one.left(clock.now) == pytest.approx(2.0 * 7)
    assert one.left(clock.now + 4.0) == pytest.approx(2.0 * 7 - 4.0)


def test_what_an_earlier_run_finished_is_counted_and_sets_no_pace(clock):
    one = Counted(100, 90, True)
    for _ in range(3):
        clock.now += 1.0
        one.advance(1, clock.now)
    assert one.count == 93 and one.left(clock.now) == pytest.approx(7.0)


def test_states_that_other_processes_count_are_seen(display, clock):
    solved = [0]
    with progress("states", 8, done=2, poll=lambda: solved[0]):
        for done in (1, 2, 3, 99):
            solved[0] = done
            wait(display, clock, 1.0)
            assert f"{min(2 + done, 8)}/8" in display.line()


def test_what_states_cost_is_said_beside_their_number(display, clock):
    said = [""]
    with progress("states", 8, note=lambda: said[0]) as advance:
        assert "states, 0/8, 0 s" in display.line()
        said[0] = "row 7 is slow"
        assert "states, 0/8, row 7 is slow, " in display.line()
        said[0] = "12 factorisations a solve"
        advance(1)
        assert "states, 1/8, 12 factorisations a solve, " in display.line()


def test_a_terminal_has_one_line_that_is_rewritten(clock, written):
    display = Display("solve", written.append, clock, width=20)
    wait(display, clock, 1.0, step=0.1)
    assert len(written) == 10
    assert all(text.startswith("\r\x1b[K") and "\n" not in text and len(text) <= 20 + 4 for text in written)
    assert len({text[4] for text in written}) > 5


def test_nothing_is_shown_where_nothing_was_asked_for(capsys):
    with progress("solve", 3) as advance:
        doing("anything")
        advance(3)
    with shown("solve", quiet=True), progress("solve", 3) as advance:
        advance(3)
    assert capsys.readouterr() == ("", "")


def test_the_display_ends_with_its_command():
    threads = threading.active_count()
    with shown("solve"), shown("inner"):
        assert module._display.label == "inner"
    assert module._display is None and threading.active_count() == threads
