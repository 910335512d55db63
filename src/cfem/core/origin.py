"""Where the keys of a spec stand: file and line."""

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
        at: tuple = ()
        for part in path:
            below = {one[: len(at) + 1] for one in self.lines if len(one) > len(at) and one[: len(at)] == at}
            under_unit = [(*one, part) for one in below if len(below) == 1]
            nearer = [one for one in ((*at, part), *under_unit) if one in self.lines]
            if not nearer:
                break
            at = nearer[0]
        return at

    def has(self, path: tuple) -> bool:
        """Whether a key, or the mapping or list that it belongs in, is written."""
        above = path[:-1]
        if path in self.lines or self.lines.get(above) == 0:
            return True
        return any(len(one) > len(above) and one[: len(above)] == above for one in self.lines)
