"""File and line of each key of a spec."""

from dataclasses import dataclass


def key_path(text: str) -> tuple:
    """'parts.0.size' as ('parts', 0, 'size')."""
    return tuple(int(part) if part.isdigit() else part for part in text.split("."))


@dataclass(frozen=True)
class Origin:
    """The file of a spec, and the line of every key path in it: 0 for what `--set` says."""

    file: str
    lines: dict[tuple, int]

    def place(self, path: tuple) -> str:
        """'file:line: key.sub', by the nearest key that is written; '--set: key.sub' for an override."""
        line = self.lines[self._written(path)]
        key = ".".join(str(part) for part in path)
        return (f"{self.file}:{line}" if line and key else self.file if line else "--set") + (f": {key}" if key else "")

    def _written(self, path: tuple) -> tuple:
        """The key path in the file that comes nearest: points.1 is the second row under `points: {mm: [...]}`."""
        nearest: tuple = ()
        for part in path:
            below = {
                written[: len(nearest) + 1]
                for written in self.lines
                if len(written) > len(nearest) and written[: len(nearest)] == nearest
            }
            under_unit = [(*written, part) for written in below if len(below) == 1]
            nearer = [candidate for candidate in ((*nearest, part), *under_unit) if candidate in self.lines]
            if not nearer:
                made = (*nearest, part)  # by an override of a key below it, if at all
                return next((written for written in self.lines if written[: len(made)] == made), nearest)
            nearest = nearer[0]
        return nearest

    def has(self, path: tuple) -> bool:
        """True if a key, or the mapping or list that it belongs in, is written."""
        above = path[:-1]
        if path in self.lines or self.lines.get(above) == 0:
            return True
        return any(len(written) > len(above) and written[: len(above)] == above for written in self.lines)
