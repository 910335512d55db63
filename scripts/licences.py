"""The table of docs/licences.md: every package that `cfem[dev]` installs, its version and its licence, as installed.

licences.py writes it; licences.py --check exits 5 where it lists other packages than are installed."""

import re
import sys
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

PAGE = Path("docs/licences.md")
HEAD = """# Dependencies and their licences

Every package that cfem uses, with its licence, as `scripts/licences.py` finds them installed. cfem itself is
Apache-2.0 and holds no code of these; each is installed from its own package. gmsh is GPL-2.0-or-later;
`cfem/robot/mesh/gmsh_process.py` runs it in its own process. py-mkl-pardiso contains Intel's MKL, free to use and
redistribute under the Intel Simplified Software License. fmpy, which tests alone use, states its licence in its
LICENSE.txt: BSD-2-Clause.

The README of SoftRobots.Inverse, a plugin of SOFA, names the patent family FR3002047 and WO2014/122134, on the control
of deformable robots in real time by a reduction of their equations to constraint space.

| package | version | licence | needed by |
|---|---|---|---|
"""


def main() -> int:
    found = closure("cfem", {"dev"})
    text = HEAD + "".join(
        f"| {name} | {version} | {licence} | {', '.join(sorted(by))} |\n"
        for name, (version, licence, by) in sorted(found.items())
    )
    if "--check" in sys.argv:
        listed = set(re.findall(r"^\| ([^ |]+) \|", PAGE.read_text(), re.MULTILINE)) - {"package"}
        print("\n".join(sorted(listed ^ set(found))) or "current")
        return 5 if listed != set(found) else 0
    PAGE.write_text(text)
    return 0


def closure(root: str, extras: set[str]) -> dict[str, tuple[str, str, set[str]]]:
    """Installed packages that `root[extras]` leads to: version, licence, who asks for it."""
    found: dict[str, tuple[str, str, set[str]]] = {}
    waiting, seen = [(root, extra) for extra in ("", *extras)], set()
    while waiting:
        name, extra = waiting.pop()
        if (name, extra) in seen:
            continue
        seen.add((name, extra))
        for text in distribution(name).requires or []:
            need = Requirement(text)
            if need.marker and not need.marker.evaluate({"extra": extra}):
                continue
            key = re.sub(r"[-_.]+", "-", need.name).lower()
            try:
                package = distribution(key)
            except PackageNotFoundError:
                continue
            if key != root:
                found.setdefault(key, (package.version, licence(package.metadata), set()))[2].add(name)
            waiting += [(key, one) for one in ("", *need.extras)]
    return found


def licence(metadata) -> str:
    """SPDX expression where there is one, else the classifier, else the first line of the field."""
    classifiers = [text.split(" :: ")[-1] for text in metadata.get_all("Classifier", []) if text.startswith("License")]
    stated = (metadata.get("License") or "").strip().splitlines()
    return metadata.get("License-Expression") or "; ".join(classifiers) or (stated[0][:60] if stated else "not stated")


if __name__ == "__main__":
    sys.exit(main())
