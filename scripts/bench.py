"""Compares the benchmarks with those of the last release, as multiples of the reference benchmark of the same run.

bench.py RUN_JSON           prints a table; exit 5 where a benchmark is slower by more than LIMIT
bench.py RUN_JSON --write   stores the run as that of this release: benchmarks/release.json"""

import json
import sys
from pathlib import Path

from cfem import __version__

RELEASE = Path(__file__).parents[1] / "benchmarks" / "release.json"
LIMIT = 2.5  # shared machines scatter by up to 2


def multiples(run: dict) -> dict[str, float]:
    """Median of each benchmark over that of the reference."""
    medians = {one["fullname"].split("/")[-1]: one["stats"]["median"] for one in run["benchmarks"]}
    reference = medians.pop("test_reference.py::test_reference")
    return {name: median / reference for name, median in sorted(medians.items())}


def compare(now: dict[str, float], then: dict[str, float]) -> tuple[list[str], list[str]]:
    """Lines of a table; names of what is slower by more than LIMIT."""
    lines = [f"{'benchmark':58} {'now':>8} {'release':>8} {'change':>7}"]
    for name, value in now.items():
        before = then.get(name)
        change = f"{value / before:6.2f}x" if before else "new"
        lines.append(f"{name[:58]:58} {value:8.3g} {before if before else float('nan'):8.3g} {change:>7}")
    return lines, [name for name, value in now.items() if value > LIMIT * then.get(name, value)]


def main(path: Path, write: bool) -> int:
    now = multiples(json.loads(path.read_text()))
    if write:
        RELEASE.write_text(json.dumps({"release": __version__, "multiples": now}, indent=1) + "\n")
        return 0
    release = json.loads(RELEASE.read_text())
    lines, slower = compare(now, release["multiples"])
    print(f"multiples of the reference benchmark, compared with release {release['release']}", *lines, sep="\n")
    if slower:
        print(f"slower by more than {LIMIT:g} times: {', '.join(slower)}", file=sys.stderr)
    return 5 if slower else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), "--write" in sys.argv[2:]))
