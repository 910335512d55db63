"""Are the committed scenes' datasets still what they were? Used by `make regenerate` and by CI.

    regenerate.py [SCENE ...]           makes what is stale, compares with tests/gold/<scene>.json; 5 on a difference
    regenerate.py --each [SCENE ...]    the same, and prints every number that differs, not the worst of each column
    regenerate.py --check [SCENE ...]   runs nothing; exit 5 where a dataset is stale
    regenerate.py --write [SCENE ...]   writes the gold files from the datasets as they are now

Stale is what other inputs made, or another code: whether a number still comes out is asked of the code as it is. A
gold file holds mean and standard deviation of every number of the converged rows, and a few whole rows. Tolerances:
a number may differ by RELATIVE of its column's size, which is far above what machines and solvers round differently
and far below what a change of the mechanics does."""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cfem.condensed import Rows
from cfem.condensed.packing import packed_indices
from cfem.core.artefact.files import content_sha256, file_sha256
from cfem.dataset.inspect import dataset_files
from cfem.dataset.reader import CONVERGED, column_array, read_table
from cfem.dataset.schema import metadata, rows_of

SCENES = ("bar", "stiff-flop")
GOLD = Path("tests/gold")
RELATIVE = 1e-6
ROWS = 3
COLUMNS = ("u", "delta_a", "delta_e", "lambda_a", "W", "delta_free", "energy")
CFEM = [str(Path(sys.executable).with_name("cfem"))]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--each", action="store_true")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    if options.write:
        for scene in options.scenes:
            (GOLD / f"{scene}.json").write_text(json.dumps(gold(samples(scene)), indent=1) + "\n")
        return 0
    codes = [make(scene, options.check) for scene in options.scenes]
    if any(codes) or options.check:
        return max(codes)
    found = [compare(scene, samples(scene), GOLD) for scene in options.scenes]
    notes, off = [line for one, _ in found for line in one], [each for _, one in found for each in one]
    print("\n".join(notes + table(off, options.each)) or f"{', '.join(options.scenes)}: all numbers as committed")
    return 5 if notes or off else 0


def samples(scene: str) -> Path:
    return Path("data") / scene / "samples"


def make(scene: str, check: bool) -> int:
    """Exit code of the two stages; stale ones are regenerated, unless `check`."""
    mark, now = Path("data") / scene / ".code.json", code()
    known = mark.exists() and json.loads(mark.read_text()) == now
    for stage, spec in (("mesh", "scene"), ("sample", "sample")):
        words = [*CFEM, stage, f"pipelines/{scene}/{spec}.yaml"]
        done = subprocess.run([*words, "--check", "--json"], capture_output=True, text=True)
        fresh = {0: "up to date" if known else "stale: made by another code", 5: "stale: other inputs, or none yet"}
        print(f"{scene} {stage}: {fresh.get(done.returncode) or done.stderr.strip()}", flush=True)
        left = 5 if done.returncode == 0 and not known else done.returncode
        if left == 5 and not check:
            left = subprocess.run([*words, "--force", "--quiet"], stdout=subprocess.DEVNULL).returncode
        if left:
            return left
    if not check:
        mark.write_text(json.dumps(now))
    return 0


def code() -> str:
    """Hash of all modules of cfem and of the versions that it is tested with."""
    files = [*sorted(Path("src/cfem").rglob("*.py")), Path("constraints.txt")]
    return content_sha256({path.as_posix(): file_sha256(path) for path in files})


def gold(samples: Path) -> dict:
    """Of every split of a dataset."""
    return {file.stem: summary(file) for file in dataset_files(samples)}


def summary(file: Path) -> dict:
    table = read_table(file)
    status = np.array(table["status"].to_pylist())
    found = {"rows": len(table), "failed": int((status != CONVERGED).sum()), "columns": {}}
    solved = table.filter(status == CONVERGED)
    picked = np.unique(np.linspace(0, len(solved) - 1, ROWS).astype(int))
    found["ids"] = column_array(solved, "id")[picked].tolist()
    for name in COLUMNS:
        values = column_array(solved, name).reshape(len(solved), -1)
        columns = {"mean": values.mean(axis=0), "std": values.std(axis=0), "gold": values[picked]}
        found["columns"][name] = {key: value.tolist() for key, value in columns.items()}
    return found


class Difference(NamedTuple):
    """kind: 'mean', 'std', or 'gold' for a number of row `row` of those picked; name: of the number in its column;
    off: in units of the column's size."""

    where: str
    column: str
    kind: str
    row: int
    name: str
    committed: float
    found: float
    off: float


def size(one: Difference) -> float:
    """For the worst of several: what is no number is worse than all."""
    return np.inf if np.isnan(one.off) else one.off


def compare(scene: str, folder: Path, golds: Path) -> tuple[list[str], list[Difference]]:
    """Sentences on what cannot be compared, and every number that differs."""
    committed, found = json.loads((golds / f"{scene}.json").read_text()), gold(folder)
    names = {file.stem: number_names(rows_of(metadata(read_table(file)))) for file in dataset_files(folder)}
    notes, off = [], []
    for split in sorted(committed.keys() | found.keys()):
        old, new, where = committed.get(split), found.get(split), f"{scene}/{split}"
        if old is None or new is None:
            notes.append(f"{where}: {'not committed' if old is None else 'missing'}")
            continue
        notes += [
            f"{where} {key}: {old[key]} -> {new[key]}" for key in ("rows", "failed", "ids") if old[key] != new[key]
        ]
        for column in COLUMNS:
            for kind in ("mean", "std", "gold"):
                before, after = (np.atleast_2d(one["columns"][column][kind]) for one in (old, new))
                if before.shape != after.shape:
                    notes.append(f"{where} {column} {kind}: {before.shape} numbers -> {after.shape}")
                    continue
                relative = np.abs(after - before) / (np.abs(old["columns"][column]["gold"]).max() or 1.0)
                for row, k in np.argwhere(~(relative <= RELATIVE)):
                    name = names[split].get(column, {}).get(int(k), f"{k}" if before.shape[1] > 1 else "")
                    numbers = (float(one[row, k]) for one in (before, after, relative))
                    off.append(Difference(where, column, kind, old["ids"][row], name, *numbers))
    return notes, off


def number_names(rows: Rows) -> dict[str, dict[int, str]]:
    """By column, of the numbers in it."""
    pairs = [f"{rows.names[i]} x {rows.names[j]}" for i, j in zip(*packed_indices(rows.n), strict=True)]
    named = {"delta_e": rows.effectors, "W": pairs, "delta_free": rows.names}
    named |= dict.fromkeys(("u", "delta_a", "lambda_a"), rows.actuators)
    return {column: dict(enumerate(names)) for column, names in named.items()}


def table(off: list[Difference], each: bool) -> list[str]:
    """Lines for a person: the worst number of each column, or every one; none where nothing differs."""
    if not off:
        return []
    columns: dict[tuple[str, str], list[Difference]] = {}
    for one in off:
        columns.setdefault((one.where, one.column), []).append(one)
    shown = [(one, 1) for one in off] if each else [(max(found, key=size), len(found)) for found in columns.values()]
    cells = [("dataset", "column", "number", "committed", "found", "difference", "numbers")]
    for one, count in shown:
        place = f"row {one.row}" if one.kind == "gold" else one.kind
        figures = f"{one.committed:.9g}", f"{one.found:.9g}", f"{one.off:.1e}"
        cells.append((one.where, one.column, f"{one.name} {place}".strip(), *figures, "" if each else f"{count}"))
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in cells]
    says = f"{len(off)} numbers differ; 'difference' is relative to the column's size, allowed is {RELATIVE:g}"
    return [*lines, says if each else f"{says}; the worst of each column, --each prints all"]


if __name__ == "__main__":
    sys.exit(main())
