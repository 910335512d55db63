"""What the loops of `make stiff-flop-experiments` found, beside the paper's figures, as tables of Markdown.

python benchmarks/stiff_flop_experiments.py [data/stiff-flop-experiments]"""

import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from cfem.core.artefact.content import artefact_file
from cfem.core.artefact.manifest import read_manifest

COLUMNS = ("trajectory", "controller", "tick", "seconds", "goal_index", "error", "step_us")
BUDGET, RADIUS, PUSHED = 80.0, 0.5, 180


def read(folder: Path) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Columns by trajectory and controller."""
    table = pq.read_table(artefact_file(folder, "loop.parquet"), columns=list(COLUMNS), page_checksum_verification=True)
    columns = {name: np.array(table[name].to_pylist()) for name in COLUMNS}
    keys = dict.fromkeys(zip(columns["trajectory"], columns["controller"], strict=True))
    masks = {key: (columns["trajectory"] == key[0]) & (columns["controller"] == key[1]) for key in keys}
    return {key: {name: each[mask] for name, each in columns.items()} for key, mask in masks.items()}


def circle(folder: Path, name: str) -> None:
    approach = read_manifest(folder / name)["spec"]["trajectories"]["circle"]["from_rest"]
    for (_, controller), run in read(folder / name).items():
        error, milliseconds = run["error"], run["step_us"] / 1000
        off = f"{error[approach:].mean():.2g} / {error[approach:].max():.2g}"
        steps = f"{np.median(milliseconds):.3g} / {milliseconds.mean():.3g}"
        points = int((error <= RADIUS).mean() * BUDGET / (milliseconds.mean() / 1000))
        print(f"| {name} | {controller} | {off} | {error[:approach].max():.2g} | {steps} | {points} |")


def points(folder: Path, name: str) -> None:
    found = read_manifest(folder / name)["results"]["loop"]
    for trajectory, controllers in found.items():
        for controller, row in controllers.items():
            wait, rate = row["ticks_to_converge"], row["ticks"] / row["seconds"]
            held = f"{wait['median']:.0f} ticks, {wait['median'] / rate:.3g} s" if wait["held"] else "not held"
            end = row["error_at_goals"]["max"]
            print(f"| {name} | {trajectory} | {controller} | {held} | {end:.2g} |")


def disturbance(folder: Path) -> None:
    for (_, controller), run in read(folder / "disturbance").items():
        before, after = run["error"][: PUSHED - 1], run["error"][PUSHED - 1 :]
        outside = np.flatnonzero(after > RADIUS)
        back = "none" if outside[-1] == len(after) - 1 else f"{outside[-1] + 1} ticks"
        print(f"| {controller} | {before[-1]:.2g} | {after.max():.2g} | {back} | {after[-1]:.2g} |")


def main(folder: Path) -> None:
    print("| run | controller | error on the circle, mean / max mm | on the approach, max mm |", end="")
    print(" CPU per tick, median / mean ms | goals reached to 0.5 mm in 80 s |\n|---|---|---|---|---|---|")
    for name in ("circle", "circle-published", "circle-bbrfem"):
        circle(folder, name)
    print("\n| run | point | controller | settled within 0.5 mm after | error at the end, mm |\n|---|---|---|---|---|")
    for name in ("points", "points-softer", "points-finer", "points-bbrfem", "points-5hz"):
        points(folder, name)
    print("\n| controller | error before, mm | largest after | back within 0.5 mm after | error at the end, mm |")
    print("|---|---|---|---|---|")
    disturbance(folder)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "data/stiff-flop-experiments"))
