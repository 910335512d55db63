"""`cfem demo`: a robot that comes with cfem, through all its stages, and the numbers that matter."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cfem.core.artefact.judgement import sentences
from cfem.core.artefact.manifest import read_manifest
from cfem.core.console.progress import say
from cfem.core.console.shown import duration, length, times
from cfem.core.errors import SpecError
from cfem.core.stage import Options
from cfem.pipeline.plan import Step
from cfem.pipeline.robots import ROBOTS, copy_robot, robots
from cfem.pipeline.run import run

FINGER = "soft-finger"
# What a stage does, and about how long for the finger on a laptop.
STAGES = {
    "scene": ("meshing the robot", "10 s"),
    "sample": ("solving equilibria by finite elements (FE), to learn from", "30 s"),
    "train": ("fitting a small model to them", "2 s"),
    "export": ("writing the model for a controller", "5 s"),
    "export-page": ("writing the page in which you move the robot", "1 s"),
    "control": ("following a curve with the model; the FE robot is the judge", "1 min"),
    "report": ("drawing the report", "10 s"),
}


def demo(robot: str, folder: Path, options: Options) -> dict[str, Any]:
    """Copies the robot's specs to `folder` where they are not there yet, and runs what is not up to date. Returns what
    `cfem run` does; results also: numbers, the sentences to read first."""
    place = folder / robot
    if not place.is_dir():
        if not (ROBOTS / robot / "control.yaml").is_file() and robot in robots():
            shown = sorted(path.parent.name for path in ROBOTS.glob("*/control.yaml"))
            raise SpecError(
                f"{robot} comes without a curve to follow", where="demo", do=f"use one of {', '.join(shown)}"
            )
        copy_robot(robot, robot, folder)
    if not options.quiet:
        say(f"the robot's YAML files are in {place}; results go to the folders data and models")

    def line(number: int, steps: Sequence[Step], why: Sequence[str]) -> str:
        step = steps[number]
        what, about = STAGES.get(step.spec.stem, STAGES.get(step.kind, (step.command, "")))
        time_left = "up to date" if not why else f"about {about}" if robot == FINGER and about else ""
        return f"step {number + 1}/{len(steps)}: {what}" + (f" ({time_left})" if time_left else "")

    outcome = run([place], [], options, line=None if options.quiet else line)
    results = outcome["results"]
    runs = [read_manifest(Path(stage["out"]))["results"] for stage in results["stages"] if stage["stage"] == "control"]
    figures = [line for result in runs if "trajectories" in result for line in numbers(result)]
    return outcome | {"results": results | {"numbers": figures}}


def numbers(control: Mapping[str, Any]) -> list[str]:
    """Goals reached, tracking error beside the discretisation error, and time per control step beside an FE solve, of
    the first learned controller. control: results of `cfem control`."""
    name, summary = _learned(control["trajectories"])
    near, mesh, cost = summary["distance_to_reachable_goals"], control["discretisation"], control["fe_cost"]
    error = f"{length(near['mean'])} on average" if near else "none, as no goal is in reach,"
    error += " on the mesh that the model has learned"
    if "tip_mm" in mesh:
        finer = f"up to {length(mesh['tip_mm'], digits=2)} ({mesh['tip_percent']:.2g} % of the robot's length)"
        error = f"{finer} in a robot of a much finer mesh, as estimated; {error}"
    else:
        error += f"; on a finer mesh it is not known: {mesh['left_out']}"
    step = summary["step_us"]["median"] / 1e6
    against = ""
    if cost and cost["solves"]:
        solve = cost["seconds"] / cost["solves"]
        against = f"; one FE solve takes {duration(solve)}, {times(solve / step)} times as long"
    return [
        f"goals reached:      {summary['reached']} of {summary['goals']} of the curve '{name}', "
        "in finite elements (FE)",
        f"tracking error:     {error}",
        f"time per step:      {duration(step)} with the learned model{against}",
    ]


def _learned(trajectories: Mapping[str, Mapping[str, Any]]) -> tuple[str, Mapping[str, Any]]:
    name, controllers = next(iter(trajectories.items()))
    return name, next(summary for who, summary in controllers.items() if who != "fe-based" and "@" not in who)


def as_text(outcome: Mapping[str, Any]) -> str:
    """Text on what is poor about the results, the three numbers and the pages."""
    results = outcome["results"]
    pages = [f"report:             {page}" for page in results["pages"]]
    pages += [f"robot to move:      {page}" for page in results["moved"]]
    pages += ["open both pages in a browser"] if len(pages) > 1 else []
    return "\n".join([*sentences(results), *results["numbers"], *pages])
