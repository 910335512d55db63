"""Are the committed scenes' datasets still what they were? Used by `make regenerate` and by CI.

    regenerate.py [SCENE ...]           makes what is stale, compares with tests/gold/<scene>.json; 5 on a difference
    regenerate.py --check [SCENE ...]   runs nothing; exit 5 where a dataset is stale
    regenerate.py --write [SCENE ...]   writes the gold files from the datasets as they are now

A gold file holds mean and standard deviation of every number of the converged rows, and a few whole rows. Tolerances:
a number may be off by RELATIVE of its column's size, which is far above what machines and solvers round differently
and far below what a change of the mechanics does."""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from cfem.dataset.inspect import dataset_files
from cfem.dataset.reader import CONVERGED, column_array, read_table

SCENES = ("bar", "stiff-flop")
GOLD = Path("tests/gold")
RELATIVE = 1e-6
ROWS = 3
COLUMNS = ("u", "delta_a", "delta_e", "lambda_a", "W", "delta_free", "energy")
STATE = {0: "up to date", 5: "stale"}
CFEM = [str(Path(sys.executable).with_name("cfem"))]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=SCENES)
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    if options.write:
        for scene in options.scenes:
            (GOLD / f"{scene}.json").write_text(json.dumps(gold(Path("data") / scene / "samples"), indent=1) + "\n")
        return 0
    codes = [make(scene, options.check) for scene in options.scenes]
    if any(codes) or options.check:
        return max(codes)
    different = [line for scene in options.scenes for line in compare(scene, Path("data") / scene / "samples", GOLD)]
    print("\n".join(different) or f"{', '.join(options.scenes)}: all numbers as committed")
    return 5 if different else 0


def make(scene: str, check: bool) -> int:
    """Exit code of the two stages; stale ones are made anew, unless `check`."""
    for stage, spec in (("mesh", "scene"), ("simulate-sample", "sample")):
        words = [*CFEM, stage, f"pipelines/{scene}/{spec}.yaml"]
        code = subprocess.run([*words, "--check", "--json"], stdout=subprocess.DEVNULL).returncode
        print(f"{scene} {stage}: {STATE.get(code, f'exit {code}')}", flush=True)
        if code == 5 and not check:
            code = subprocess.run([*words, "--force", "--quiet"], stdout=subprocess.DEVNULL).returncode
        if code:
            return code
    return 0


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


def compare(scene: str, samples: Path, folder: Path) -> list[str]:
    """A line for each number that differs: where, committed, found, how far in units of the column's size."""
    committed, found = json.loads((folder / f"{scene}.json").read_text()), gold(samples)
    lines = []
    for split in sorted(committed.keys() | found.keys()):
        old, new = committed.get(split), found.get(split)
        if old is None or new is None:
            lines.append(f"{scene}/{split}: {'not committed' if old is None else 'missing'}")
            continue
        for key in ("rows", "failed", "ids"):
            if old[key] != new[key]:
                lines.append(f"{scene}/{split} {key}: {old[key]} -> {new[key]}")
        for name in COLUMNS:
            for kind in ("mean", "std", "gold"):
                lines += differences(f"{scene}/{split} {name} {kind}", old["columns"][name], new["columns"][name], kind)
    return lines


def differences(where: str, old: dict, new: dict, kind: str) -> list[str]:
    before, after = np.array(old[kind]), np.array(new[kind])
    if before.shape != after.shape:
        return [f"{where}: {before.shape} numbers -> {after.shape}"]
    size = np.abs(old["gold"]).max()
    off = np.abs(after - before) / (size or 1.0)
    return [
        f"{where}{list(map(int, place))}: {before[tuple(place)]:.9g} -> {after[tuple(place)]:.9g} "
        f"({off[tuple(place)]:.1e} of the column's size, allowed {RELATIVE:g})"
        for place in np.argwhere(~(off <= RELATIVE))
    ]


if __name__ == "__main__":
    sys.exit(main())
