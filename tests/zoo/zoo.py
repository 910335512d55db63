"""Bodies as strangers bring them, each through `cfem init` and `cfem run`: `python tests/zoo/zoo.py [NAME ...]`.

Results go to build/zoo, one file a body, and the table of all of them to docs/zoo.md. What is there is kept: remove
build/zoo/NAME to run a body again."""

import json
import os
import re
import resource
import subprocess
import sys
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

import meshio
import numpy as np

HERE = Path(__file__).parent
BUILD = HERE.parents[1] / "build" / "zoo"
TABLE = HERE.parents[1] / "docs" / "zoo.md"
CELLS = "500"
_CAUSES = "## Causes"
# Coarse: a measure of what works, and not of how exact it is.
COARSE = (
    "sample.splits.train.rows=40",
    "sample.splits.test.rows=10",
    "train.learning_curve=[]",
    "control.mesh_error=null",
)

# What gmsh writes in place of files that are written here.
_DRAWN = {".obj": ".stl", ".ply": ".stl", ".off": ".stl", ".3mf": ".stl", ".vtu": ".vtk", ".inp": ".vtk"}


@dataclass(frozen=True)
class Body:
    """name; drawn: the function of shapes.py; file: name of the file that a stranger brings; says: what it is; answers:
    the options that a person gives; size: of the triangles or cells in the file, mm; unit: of the file's numbers, mm;
    flaw: what is wrong with the file."""

    name: str
    drawn: str
    file: str
    says: str
    answers: tuple[str, ...] = ()
    size: float = 6.0
    unit: float = 1.0
    flaw: str | None = None


BODIES = (
    Body("finger-holes", "finger_holes", "finger.step", "finger with guide holes"),
    Body("finger-channel", "finger_channel", "finger.stl", "finger with a channel", ("--unit", "mm"), 3.0),
    Body(
        "finger-outside", "finger_outside", "finger.obj", "backbone with discs, cables outside", ("--unit", "mm"), 4.0
    ),
    Body("trunk-3", "trunk", "trunk.step", "trunk of discs and necks, 3 cables"),
    Body("trunk-4", "trunk", "trunk.vtk", "trunk, 4 cables, a volume", ("--unit", "mm", "--cables", "4"), 5.0),
    Body(
        "tentacle-6",
        "tentacle",
        "tentacle.msh",
        "tapered tentacle, 6 cables, a volume",
        ("--unit", "mm", "--cables", "6"),
    ),
    Body("tentacle-metres", "tentacle", "tentacle.stl", "tapered tentacle in metres", ("--unit", "m"), 4.0, 1000.0),
    Body("pneunet", "pneunet", "pneunet.stl", "PneuNet, its cavity an inner surface", ("--unit", "mm"), 4.0),
    Body("bellows", "bellows", "bellows.brep", "accordion with a closed chamber", ("--unit", "mm"), 5.0),
    Body("three-chambers", "three_chambers", "arm.step", "arm of three chambers"),
    Body(
        "ring-gripper",
        "ring_gripper",
        "ring.obj",
        "ring gripper of three chambers",
        ("--unit", "mm", "--fixed", "bottom", "--effector", "17.9, 0, 8"),
    ),
    Body(
        "diamond",
        "diamond",
        "diamond.msh",
        "parallel robot, upright, a volume",
        ("--unit", "mm", "--fixed", "bottom", "--cells", "500"),
    ),
    Body(
        "diamond-lying",
        "diamond_lying",
        "diamond.vtk",
        "parallel robot, lying; a VTU that is called .vtk",
        ("--unit", "mm", "--fixed", "left", "--cells", "500"),
    ),
    Body("s-shape", "s_shape", "s.brep", "S-shaped arm", ("--unit", "mm")),
    Body("l-shape", "l_shape", "l.step", "L-shaped arm"),
    Body("u-shape", "u_shape", "u.ply", "U with two legs", ("--unit", "mm")),
    Body("hollow", "hollow", "tube.off", "tube, open at both ends", ("--unit", "mm"), 4.0),
    Body(
        "lattice",
        "lattice",
        "lattice.inp",
        "lattice of struts, an Abaqus volume",
        ("--unit", "mm", "--cables", "2", "--cells", "500"),
        5.0,
    ),
    Body("sheet", "sheet", "sheet.3mf", "thin sheet", ("--cables", "2"), 6.0),
    Body("bar-inch", "bar", "bar.stl", "bar in inches", ("--unit", "25.4 mm"), 6.0, 25.4),
    Body(
        "poor-surface",
        "tentacle",
        "poor.stl",
        "tentacle with a hole, copies, turned and loose triangles",
        ("--unit", "mm"),
        4.0,
        1.0,
        "surface",
    ),
    Body("poor-volume", "bar", "poor.vtu", "bar whose cells share no nodes", ("--unit", "mm"), 6.0, 1.0, "volume"),
)


def write_file(body: Body, folder: Path) -> Path:
    """The file that a stranger brings."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / body.file
    suffix = path.suffix
    drawn = folder / f"drawn{_DRAWN.get(suffix, suffix)}"
    command = [sys.executable, str(HERE / "shapes.py"), body.drawn, str(body.size), str(drawn)]
    subprocess.run(command, check=True, capture_output=True)
    if suffix in (".step", ".brep"):
        drawn.rename(path)
        return path
    mesh = meshio.read(drawn)
    drawn.unlink()
    X = mesh.points / body.unit
    solid = "tetra" if "tetra" in mesh.cells_dict else "triangle"
    cells = mesh.cells_dict[solid]
    if solid == "triangle":
        X, place = np.unique(np.round(X, 9), axis=0, return_inverse=True)
        cells = place.ravel()[cells]
    if body.flaw == "surface":
        X, cells = flawed(X, cells)
    if body.flaw == "volume":
        X, cells = X[cells].reshape(-1, 3), np.arange(cells.size).reshape(-1, 4)
    if suffix == ".3mf":
        write_3mf(path, X, cells)
    elif body.name == "diamond-lying":  # a VTU by another name
        meshio.write(path.with_suffix(".vtu"), meshio.Mesh(X, [(solid, cells)]))
        path.with_suffix(".vtu").rename(path)
    else:
        options = {"file_format": "gmsh"} if suffix == ".msh" else {}
        meshio.write(path, meshio.Mesh(X, [(solid, cells)]), **options)
    return path


def flawed(X: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each triangle with corners of its own, one missing, one twice, every fourth turned."""
    triangles = np.vstack([triangles[1:], triangles[5:6]])
    triangles[::4] = triangles[::4, ::-1]
    return X[triangles].reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)


def write_3mf(path: Path, X: np.ndarray, triangles: np.ndarray) -> None:
    """In millimetres."""
    vertices = "".join(f'<vertex x="{x:.9g}" y="{y:.9g}" z="{z:.9g}"/>' for x, y, z in X)
    faces = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in triangles)
    model = (
        '<?xml version="1.0"?><model unit="millimeter" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources><object id="1" type="model">'
        f"<mesh><vertices>{vertices}</vertices><triangles>{faces}</triangles></mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    )
    with zipfile.ZipFile(path, "w") as package:
        package.writestr("3D/3dmodel.model", model)


def run_body(body: Body, build: Path = BUILD) -> dict:
    """What became of a body; from the file of results where that is there."""
    folder = build / body.name
    done = folder / "result.json"
    if done.is_file():
        return json.loads(done.read_text())
    path = write_file(body, folder / "brought")
    result = {
        "name": body.name,
        "file": body.file,
        "says": body.says,
        "answers": list(body.answers),
        "commit": commit(),
    }
    cells = [] if path.suffix in (".vtk", ".msh", ".vtu", ".inp") else ["--cells", CELLS]
    words = ["init", body.name, "--from", str(path), "--folder", "pipelines", "--force", *cells, *body.answers]
    result["init"] = command(words, folder)
    if result["init"]["code"] == 0:
        sets = [word for one in COARSE for word in ("--set", one)]
        result["run"] = command(["run", f"pipelines/{body.name}", "--workers", "1", *sets], folder)
    result |= outcome(body, folder)
    done.write_text(json.dumps(result, indent=1))
    return result


def commit() -> str:
    """Of this checkout, short; '-' outside of git."""
    asked = ["git", "-C", str(HERE), "rev-parse", "--short=7", "HEAD"]
    return subprocess.run(asked, capture_output=True, text=True, check=False).stdout.strip() or "-"


def command(words: Sequence[str], folder: Path) -> dict:
    """Exit code, the last lines, seconds on the clock and of computing. Its words go to .out and .err meanwhile."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    code = [sys.executable, "-m", "cfem", *words]
    written = [folder / f"{words[0]}.{stream}" for stream in ("out", "err")]
    with written[0].open("w") as out, written[1].open("w") as err:
        done = subprocess.run(code, cwd=folder, stdout=out, stderr=err, env={**os.environ}, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "code": done.returncode,
        "said": written[bool(done.returncode)].read_text().strip().splitlines()[-12:],
        "seconds": round(time.perf_counter() - begin, 1),
        "cpu_seconds": round(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, 1),
    }


def outcome(body: Body, folder: Path) -> dict:
    """Goals reached and the words of the run."""
    control = folder / "data" / body.name / "control" / "manifest.json"
    page = (folder / "data" / body.name / "report" / "robot.html").is_file()
    if not control.is_file():
        return {"reached": None, "goals": None, "page": page, "poor": []}
    results = json.loads(control.read_text())["results"]
    learned = [each for who, each in results["trajectories"]["closed-curve"].items() if "fe-based" not in who]
    scene = (folder / "pipelines" / body.name / "scene.yaml").read_text()
    placed = re.search(r"^actuators:\s*# guessed: (.*)$", scene, re.MULTILINE)
    return {
        "reached": learned[0]["reached"],
        "goals": learned[0]["goals"],
        "page": page,
        "poor": [each["what"] for each in results.get("judgement", [])],
        "actuators": len(re.findall(r"^  - kind: (?:cable|cavity)", scene, re.MULTILINE)),
        "placed": placed[1] if placed else "",
    }


def table(results: Sequence[dict]) -> str:
    """docs/zoo.md."""
    known = {each["name"]: each for each in results}
    rows = [row(body, known.get(body.name)) for body in BODIES]
    complete = sum(each["reached"] is not None and each["reached"] == each["goals"] for each in results)
    seconds = [cpu_seconds(each) for each in results]
    return f"""# The zoo

Bodies as a stranger brings them, each from its file through `cfem init` and `cfem run`, without an edit. Each is drawn
by `tests/zoo/shapes.py`. `make zoo` runs them all and writes this page; a body that has a result is not run again.

Of {len(BODIES)} bodies {len(results)} were run, and {complete} of these follow all goals of their curve. The time is
that of one processor for both commands, with about {CELLS} cells where they are made here, and 40 samples: median
{np.median(seconds):.0f} s, largest {max(seconds):.0f} s. `answers` are those given beside `--cells`; all else is what
`cfem init` suggests. `commit` is the code that a body was run with.

| body | file | actuators | time | result | answers | commit |
|---|---|---|---|---|---|---|
{chr(10).join(rows)}
"""


def row(body: Body, result: dict | None) -> str:
    """Of the table. A body that misses goals says what the run says against itself."""
    gave = " ".join(body.answers) or "none"
    if result is None:
        return f"| {body.says} | `{body.file}` | - | - | not run | `{gave}` | - |"
    failed = next((result[step] for step in ("init", "run") if result.get(step, {}).get("code")), None)
    said = "no curve" if result["reached"] is None else f"{result['reached']} of {result['goals']} goals"
    doubts = [what for what in result["poor"] if "goals" not in what and "CAD" not in what]
    if failed:
        said += f"; {' '.join(failed['said'][-1:])}"
    elif result["reached"] != result["goals"] and doubts:
        said += f"; {'; '.join(doubts)}"
    placed, gave = result.get("placed") or "-", " ".join(result["answers"]) or "none"
    placed, said = (escape(text.replace("|", "/"), quote=False) for text in (placed, said))  # Markdown may hold HTML
    cells = (body.says, f"`{body.file}`", placed, f"{cpu_seconds(result):.0f} s", said, f"`{gave}`")
    return f"| {' | '.join(cells)} | {result['commit']} |"


def cpu_seconds(result: dict) -> float:
    """Of both commands."""
    return sum(result.get(step, {}).get("cpu_seconds", 0) for step in ("init", "run"))


def main(names: Sequence[str]) -> int:
    """What stands below `_CAUSES` in docs/zoo.md is written by hand, and stays."""
    for body in (body for body in BODIES if not names or body.name in names):
        result = run_body(body)
        print(f"{body.name}: {result['reached']} of {result['goals']}", flush=True)
    files = [BUILD / body.name / "result.json" for body in BODIES]
    made, causes = table([json.loads(path.read_text()) for path in files if path.is_file()]), TABLE.read_text("utf-8")
    TABLE.write_text(f"{made}\n{_CAUSES}{causes.partition(_CAUSES)[2]}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
