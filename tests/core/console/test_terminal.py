import pytest

from cfem.core.console.terminal import printable


@pytest.mark.parametrize("text", ["plain", "two\nlines", "é µ 漢 ⠋", ""])
def test_what_people_write_stays(text):
    assert printable(text) == text


@pytest.mark.parametrize(
    "text, shown", [("\x1b[2J", r"\x1b[2J"), ("a\rb\tc\x00", r"a\rb\tc\x00"), ("\u202eabc\x9b", r"\u202eabc\x9b")]
)
def test_what_a_terminal_obeys_is_shown(text, shown):
    assert printable(text) == shown and printable(f"x\n{text}") == f"x\n{shown}"


def test_what_no_encoding_has_is_shown_too():
    assert printable("\ud800").isascii()
