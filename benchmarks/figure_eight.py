"""Tracking error against speed of every controller of a pipeline whose robot moves: a table, and a figure.

    python benchmarks/figure_eight.py pipelines/moving-finger/control.yaml [--png FILE] [--set K=V ...] [--out DIR]

Runs `cfem run` on the spec, which makes what it reads first, and prints the table in Markdown: mean and largest
distance of the tip from its goal over the laps that count, mm. The figure has that distance against speed, and the ways
of the tip at the second and the last speed. Everything is up to date where it has run before. --set and --out are those
of `cfem control`, whose inputs must then be there."""

import argparse
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import yaml

from cfem.report.style import plt

TICKS = (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50)  # mm


def results_of(spec: Path, overrides: list[str], out: Path | None) -> tuple[Path, dict]:
    """The folder that control has written, and its results."""
    command = [sys.executable, "-m", "cfem"]
    if overrides or out:
        more = [part for one in overrides for part in ("--set", one)]
        command += ["control", str(spec), *more, *(["--out", str(out)] if out else [])]
    else:
        command += ["run", str(spec)]
    subprocess.run(command, check=True, stdout=sys.stderr)
    folder = out or spec.parent / yaml.safe_load(spec.read_text())["out"]
    manifest = json.loads((folder / "manifest.json").read_text())
    return folder, manifest["results"]["loop"]


def speed_of(trajectory: str) -> float:
    return float(trajectory.split(" at ")[1].split()[0])


def table(results: dict) -> str:
    names = list(next(iter(results.values())))
    lines = ["| laps a second | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for trajectory, row in results.items():
        cells = []
        for name in names:
            error = row[name]["error"]
            shown = f"{error['mean']:.2f} / {error['max']:.2f}" if error else "no position"
            cells.append(shown + ("*" if row[name]["no_position"] else ""))
        lines.append(f"| {speed_of(trajectory):g} Hz | " + " | ".join(cells) + " |")
    medians = [np.median([row[name]["step_us"]["median"] for row in results.values()]) / 1e3 for name in names]
    lines.append("| CPU ms per tick | " + " | ".join(f"{one:.1f}" for one in medians) + " |")
    if any(row[name]["no_position"] for row in results.values() for name in names):
        lines.append("\\* the plant gave no position at some ticks")
    return "\n".join(lines)


def picture(folder: Path, results: dict, path: Path) -> None:
    names = list(next(iter(results.values())))
    columns = ["trajectory", "controller", "seed", "tick", "goal", "x_e"]
    rows = pq.read_table(folder / "loop.parquet", columns=columns).to_pylist()
    shown = [list(results)[min(1, len(results) - 1)], list(results)[-1]]
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    speeds, drawn = [speed_of(one) for one in results], [one for one in ("static", "pi", "mpc") if one in names]
    colour = {name: f"C{place}" for place, name in enumerate(names)}
    last = max(3, len(names) - 1)  # red for mpc, which is to stand out beside the blue of static
    colour = {name: {"C3": f"C{last}", f"C{last}": "C3"}.get(one, one) for name, one in colour.items()}
    for name in names:
        means = [row[name]["error"]["mean"] if row[name]["error"] else np.nan for row in results.values()]
        axes[0].loglog(speeds, means, "o-", ms=4, label=name, color=colour[name])
    axes[0].set(xlabel="laps a second (Hz)", ylabel="mean distance from the goal (mm)")
    axes[0].set_xticks(speeds, [f"{one:g}" for one in speeds])
    axes[0].minorticks_off()
    axes[0].set_yticks(TICKS, [f"{one:g}" for one in TICKS])
    axes[0].legend(fontsize=8, loc="upper left")
    for axis, trajectory in zip(axes[1:], shown, strict=True):
        mine = [row for row in rows if row["trajectory"] == trajectory]
        run_up = max(row["tick"] for row in mine) - results[trajectory][names[0]]["goals"]
        goal = np.array([r["goal"] for r in mine if r["controller"] == names[0] and r["tick"] > run_up])
        j, i = max([(0, 1), (0, 2), (1, 2)], key=lambda pair: np.linalg.det(np.cov(goal[:, pair].T)))
        axis.plot(goal[:, j], goal[:, i], "k--", lw=1, zorder=3)
        for name in drawn:
            x = np.array([r["x_e"] for r in mine if r["controller"] == name and r["tick"] > run_up])
            axis.plot(x[:, j], x[:, i], lw=2 if name == "mpc" else 1, color=colour[name], label=name)
        axis.legend(fontsize=8, loc="upper left")
        axis.set(
            xlabel=f"{'xyz'[j]} (mm)", ylabel=f"{'xyz'[i]} (mm)", title=f"{speed_of(trajectory):g} Hz; dashed: goal"
        )
        for one, limit in ((j, axis.set_xlim), (i, axis.set_ylim)):
            low, high = goal[:, one].min(), goal[:, one].max()
            limit(low - 0.5 * (high - low), high + 0.5 * (high - low))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("spec", type=Path)
    parser.add_argument("--png", type=Path, help="picture to write; figure-eight.png beside the results unless given")
    parser.add_argument("--set", action="append", default=[], dest="overrides")
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    folder, results = results_of(options.spec, options.overrides, options.out)
    print(table(results))
    path = options.png or folder.parent / f"{folder.name}-figure-eight.png"
    picture(folder, results, path)
    print(f"\n{path}")


if __name__ == "__main__":
    main()
