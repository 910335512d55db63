"""Builds cfem's wheel and uses it as someone who has no checkout does: in fresh environments, in an empty folder.

check_wheel.py [--keep FOLDER]          all, then base
check_wheel.py all --keep FOLDER        the pipeline of the bar with every extra; its exported model stays in FOLDER
check_wheel.py all --extras mesh,report the same with these extras; without `train`, the export is plain arrays
check_wheel.py base --keep FOLDER       the base alone asks that model and controls with it; weights by package

The wheel is built once and stays in FOLDER too. Exit 1 where anything fails."""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LARGEST_BASE = 250  # MB on Linux

CONTROL = """
import sys
import numpy as np
import cfem

model = cfem.load_model(sys.argv[1])
controller, plant = cfem.make_controller(model), cfem.ModelPlant(model, model.rest_e)
goal = model.rest_e + model.at_displacement(0.4 * model.reach[:, 1]).delta_e
measured = None
for _ in range(20):
    measured = plant.step(controller.tick(goal, measured).u)
error = float(np.abs(measured.x_e - goal).max())
print(f"control: {error:.1e} mm from the goal after 20 ticks")
assert error < 1e-3
heavy = {"numba", "pyarrow", "rslab", "torch", "gmsh", "matplotlib"} & set(sys.modules)
assert not heavy, heavy
"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="?", choices=["all", "base"])
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--extras", default="all")
    given = parser.parse_args()
    os.environ.pop("PYTHONPATH", None)  # a checkout on it would stand in for the wheel
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        keep = (given.keep or Path(scratch) / "kept").resolve()
        wheel = build(keep)
        for what in [given.what] if given.what else ["all", "base"]:
            if what == "all":
                check_all(wheel, Path(scratch) / what, keep / "model", given.extras)
            else:
                check_base(wheel, Path(scratch) / what, keep / "model")
    return 0


def run(*words: str | Path, folder: Path) -> str:
    """stdout; shows the command, and all that it says where it fails."""
    shown = [word.name if isinstance(word, Path) else word for word in words]
    print("$", *(word if "\n" not in word else "..." for word in shown), flush=True)
    done = subprocess.run([str(word) for word in words], cwd=folder, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"exit {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def build(keep: Path) -> Path:
    """The wheel, made where there is none yet."""
    keep.mkdir(parents=True, exist_ok=True)
    if not list(keep.glob("cfem-*.whl")):
        run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", keep, ROOT, folder=keep)
    (wheel,) = keep.glob("cfem-*.whl")
    return wheel


def install(wheel: Path, folder: Path, extras: str) -> Path:
    """The folder of the programs of a fresh environment with the wheel."""
    venv.create(folder, with_pip=True)
    programs = folder / ("Scripts" if sys.platform == "win32" else "bin")
    pinned = ("-c", ROOT / "constraints.txt")
    words = ("-m", "pip", "install", "-q", "--no-compile", "--disable-pip-version-check", *pinned, f"{wheel}{extras}")
    run(programs / "python", *words, folder=folder)
    return programs


def check_all(wheel: Path, folder: Path, model: Path, extras: str) -> None:
    programs = install(wheel, folder / "venv", f"[{extras}]")
    print(run(programs / "cfem", "init", "my-bar", "--robot", "bar", folder=folder), end="")
    if not {"all", "train"} & set(extras.split(",")):
        (folder / "pipelines" / "my-bar" / "export.yaml").open("a").write("formats: [arrays]\n")
    print(run(programs / "cfem", "run", "pipelines/my-bar", "--quiet", folder=folder), end="")
    print(run(programs / "cfem", "verify", folder=folder), end="")
    shutil.rmtree(model, ignore_errors=True)
    shutil.copytree(next(folder.glob("models/*/spectral-export")), model)


def check_base(wheel: Path, folder: Path, model: Path) -> None:
    programs = install(wheel, folder / "venv", "")
    weigh(next((folder / "venv").rglob("site-packages")))
    print(run(programs / "python", "-c", CONTROL, model, folder=folder), end="")
    print(run(programs / "cfem", "verify", model, folder=folder), end="")
    shutil.copytree(ROOT / "pipelines" / "bar", folder / "bar")
    words = [programs / "cfem", "mesh", "bar/scene.yaml"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True)
    print(done.stderr, end="")
    if done.returncode != 2 or "pip install 'cfem[" not in done.stderr:
        sys.exit("the base alone does not say what a mesh needs")


def weigh(packages: Path) -> None:
    """MB of each package, the installer's own apart."""
    sizes: dict[str, float] = {}
    for path in packages.rglob("*"):
        if path.is_file():
            name = path.relative_to(packages).parts[0].split("-")[0].split(".")[0]
            sizes[name] = sizes.get(name, 0.0) + path.stat().st_size / 1e6
    installer = sum(sizes.pop(name, 0.0) for name in ("pip", "setuptools", "pkg_resources", "_distutils_hack"))
    for name, size in sorted(sizes.items(), key=lambda item: -item[1])[:10]:
        print(f"{size:8.1f} MB  {name}")
    total = sum(sizes.values())
    print(f"{total:8.1f} MB  in all, and {installer:.0f} MB of pip")
    if sys.platform == "linux" and total > LARGEST_BASE:
        sys.exit(f"the base weighs more than {LARGEST_BASE} MB")


if __name__ == "__main__":
    sys.exit(main())
