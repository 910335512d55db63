"""Text on its way to a terminal: names and sentences from files must not move its cursor, or write its title."""


def printable(text: str) -> str:
    """Text with what a terminal would not show, or would obey, as escape sequences: '\\x1b[2J'. Ends of lines stay."""
    if text.replace("\n", "").isprintable():
        return text
    return "".join(char if char == "\n" or char.isprintable() else _escaped(char) for char in text)


def _escaped(char: str) -> str:
    return char.encode("unicode_escape").decode("ascii")
