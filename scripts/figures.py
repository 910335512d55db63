"""Gathers the figures of the README from artefacts and benchmarks, or writes them into it.

figures.py measure   runs the short benchmarks, reads the manifests, writes docs/figures.json and the table
figures.py write     puts the table of docs/figures.json between the marks in README.md"""

import json
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FIGURES = ROOT / "docs" / "figures.json"
MARKS = "<!-- figures -->", "<!-- /figures -->"


def measure() -> dict:
    """Everything the table needs, from files that the pipelines made and from three short runs."""
    control = results("data/soft-finger/control-large")["trajectories"]
    spectral, mlp = (results(f"models/soft-finger/{name}") for name in ("spectral-large", "mlp"))
    samples, tet4 = results("data/soft-finger/samples-large"), results("data/soft-finger-tet4/samples")
    reach = control["closed-curve"]
    arc = control["quarter-circle"]
    return {
        "verification": run("benchmarks/verification.py", "pipelines/soft-finger/scene.yaml"),
        "samples": {key: samples[key] for key in ("rows", "failed", "residual_max", "factorizations_per_sample")},
        "tet4": {key: tet4[key] for key in ("samples_per_second_per_core", "factorizations_per_sample")},
        "tet4_cells": results("data/soft-finger-tet4/mesh")["cells"],
        "learning_curve": {str(row["samples"]): row["errors"]["loss"] for row in spectral["learning_curve"]},
        "spectral": model_figures(spectral),
        "mlp": model_figures(mlp),
        "closed_curve": {name: reach[name]["distance_to_reachable_goals"] for name in ("fe-based", "spectral", "mlp")},
        "quarter_circle": {name: arc[name]["distance_to_fe_based"] for name in ("spectral", "mlp")},
        "reachable": [arc["fe-based"]["reachable"], arc["fe-based"]["goals"]],
        "process": run("benchmarks/control_process.py", "models/soft-finger/spectral-large-export"),
        "discretisation": results("data/soft-finger/report-large")["discretisation"],
        "help_seconds": min(timed([sys.executable, "-m", "cfem", "--help"]) for _ in range(5)),
    }


def model_figures(result: dict) -> dict:
    errors = result["errors"]
    picked = {name: errors[name]["max"] for name in ("tip_mm", "force_N")}
    return {"samples": result["samples"], "seconds": result["seconds_fit"], "loss": errors["loss"], **picked}


def results(folder: str) -> dict:
    return json.loads((ROOT / folder / "manifest.json").read_text())["results"]


def run(script: str, *words: str) -> dict:
    done = subprocess.run([sys.executable, script, *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def timed(command: list[str]) -> float:
    begin = time.perf_counter()
    subprocess.run(command, check=True, capture_output=True)
    return time.perf_counter() - begin


def table(f: dict) -> str:
    """Markdown: what, target, measured, command."""
    v, curve, spectral, mlp = f["verification"], f["learning_curve"], f["spectral"], f["mlp"]
    loop, arc, process = f["closed_curve"], f["quarter_circle"], f["process"]
    used = next(row for row in f["discretisation"] if row["element"] == "tet10p0" and row["size"] == 9)
    verify = "`benchmarks/verification.py`"
    rows = [
        ("tangent against finite differences", "1e-6", f"{v['tangent']:.1e}", verify),
        ("W against finite differences of whole solves", "1e-6", f"{v['W']:.1e}", verify),
        ("energy gradient against cable forces", "1e-6", f"{v['energy_gradient']:.1e}", verify),
        ("patch test; rigid motion; cantilever against the elastica", "1e-12; 1e-12; 1 %", "asserted", "`make test`"),
        (
            f"largest residual of {sum(f['samples']['rows'].values())} stored states ({f['samples']['failed']} failed)",
            "1e-8",
            f"{f['samples']['residual_max']:.1e}",
            "`cfem sample sample-large.yaml`",
        ),
        (
            "factorisations a sample: this mesh / linear tetrahedra",
            "2.5",
            f"{f['samples']['factorizations_per_sample']:.2f} / {f['tet4']['factorizations_per_sample']:.2f}",
            "`cfem inspect data/soft-finger/samples-large`",
        ),
        (
            f"samples a second, one core, {f['tet4_cells']} tet4",
            "30",
            f"{f['tet4']['samples_per_second_per_core']:.0f}",
            "`cfem sample ../soft-finger-tet4/sample.yaml`",
        ),
        (
            "energy model, the paper's loss from 30 / 50 / 100 / 200 samples",
            "3.8e-6 / - / - / 1e-9",
            " / ".join(f"{curve[n]:.1e}" for n in ("30", "50", "100", "200")),
            "`cfem train train-large.yaml`",
        ),
        (
            "its largest errors on the test states: tip, cable force",
            "",
            f"{spectral['tip_mm']:.1e} mm, {spectral['force_N']:.1e} N",
            "same",
        ),
        (
            f"the paper's network, {mlp['samples']} samples: loss; largest tip error; training",
            "3.8e-6",
            f"{mlp['loss']:.1e}; {mlp['tip_mm']:.2f} mm; {mlp['seconds'] / 60:.1f} min",
            "`cfem train train-mlp.yaml`",
        ),
        (
            "closed curve in the FE plant, energy model: distance to the goals, mean / max",
            "0.02 / 0.1 mm",
            f"{loop['spectral']['mean']:.1e} / {loop['spectral']['max']:.1e} mm",
            "`cfem control control-large.yaml`",
        ),
        ("the same with the paper's network", "", f"{loop['mlp']['mean']:.2g} / {loop['mlp']['max']:.2g} mm", "same"),
        (
            f"the paper's quarter circle, {f['reachable'][0]} of {f['reachable'][1]} goals in reach: from FE control",
            "0.02 / 0.1 mm",
            f"{arc['spectral']['mean']:.1e} / {arc['spectral']['max']:.1e} mm",
            "same",
        ),
        ("the same with the paper's network", "", f"{arc['mlp']['mean']:.2g} / {arc['mlp']['max']:.2g} mm", "same"),
        (
            "control step (query + QP), one core, median / p99",
            "150 us",
            f"{process['median_us']:.0f} / {process['p99_us']:.0f} us",
            "`benchmarks/control_process.py`",
        ),
        ("memory of that process, no PyTorch", "60 MiB", f"{process['peak_rss_mib']:.0f} MiB", "same"),
        (
            "discretisation of the default mesh: W, tip against a finer one",
            "",
            f"{100 * used['W_relative_max']:.1f} %, {used['tip_mm_max']:.2g} mm",
            "`cfem report report-large.yaml`",
        ),
        ("`cfem --help`", "0.5 s", f"{f['help_seconds']:.2f} s", ""),
    ]
    lines = ["| figure | target | measured | command |", "|---|---|---|---|"]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def with_table(readme: str, figures: dict) -> str:
    head, rest = readme.split(MARKS[0])
    _, tail = rest.split(MARKS[1])
    return f"{head}{MARKS[0]}\n{table(figures)}\n{MARKS[1]}{tail}"


def main(what: str) -> None:
    if what == "measure":
        FIGURES.write_text(json.dumps(measure(), indent=1) + "\n")
    readme = ROOT / "README.md"
    readme.write_text(with_table(readme.read_text(), json.loads(FIGURES.read_text())))


if __name__ == "__main__":
    main(sys.argv[1])
