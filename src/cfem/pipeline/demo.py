"""`cfem demo`: a robot that comes with cfem, through all its stages, and the numbers that matter."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cfem.core.errors import SpecError
from cfem.core.judgement import sentences
from cfem.core.progress import say
from cfem.core.shown import duration, length
from cfem.core.stage import Options, read_manifest
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
    "control": ("following a curve with the model; the FE robot is the judge", "30 s"),
    "report": ("drawing the report", "10 s"),
}


def demo(robot: str, folder: Path, options: Options) -> dict[str, Any]:
    """Copies the robot's specs to `folder` where they are not there yet, compiles what has to be compiled, and runs
    what is not up to date. Returns what `cfem run` does; results also: numbers, the sentences to read first."""
    place = folder / robot
    if not place.is_dir():
        if not (ROBOTS / robot / "control.yaml").is_file() and robot in robots():
            shown = sorted(path.parent.name for path in ROBOTS.glob("*/control.yaml"))
            raise SpecError(f"{robot} follows no curve", where="demo", do=f"use one of {', '.join(shown)}")
        copy_robot(robot, robot, folder)
    if not options.quiet:
        say(f"the robot's specs are in {place}; what is made of them goes to data and models")

    def line(number: int, steps: Sequence[Step], why: Sequence[str]) -> str:
        if number == 0:
            _compile(len(steps), bool(why))
        step = steps[number]
        what, about = STAGES.get(step.spec.stem, STAGES.get(step.kind, (step.command, "")))
        left = "up to date" if not why else f"about {about}" if robot == FINGER and about else ""
        return f"step {number + 2}/{len(steps) + 1}: {what}" + (f" ({left})" if left else "")

    outcome = run([place], [], options, line=None if options.quiet else line)
    results = outcome["results"]
    runs = [read_manifest(Path(one["out"]))["results"] for one in results["stages"] if one["stage"] == "control"]
    said = [line for one in runs if "trajectories" in one for line in numbers(one)]
    return outcome | {"results": results | {"numbers": said}}


def _compile(steps: int, needed: bool) -> None:
    from cfem.stability.warm_up import is_warm, warm_up

    warm = not needed or is_warm()
    say(f"step 1/{steps + 1}: compiling the solver ({'up to date' if warm else 'once per installation, about 20 s'})")
    if not warm:
        warm_up()


def numbers(control: Mapping[str, Any]) -> list[str]:
    """Goals reached, tracking error beside the discretisation error, and time per control step beside an FE solve, of
    the first learned controller. control: results of `cfem control`."""
    name, found = _learned(control["trajectories"])
    near, mesh, cost = found["distance_to_reachable_goals"], control["discretisation"], control["fe_cost"]
    error = f"{length(near['mean'])} on average" if near else "none, as no goal is in reach"
    if "tip_mm" in mesh:
        error += (
            f"; the mesh itself leaves {mesh['tip_mm']:.2g} mm ({mesh['tip_percent']:.2g} % of the length) uncertain"
        )
    else:
        error += f"; the discretisation error is not known: {mesh['left_out']}"
    step = found["step_us"]["median"] / 1e6
    against = ""
    if cost and cost["solves"]:
        solve = cost["seconds"] / cost["solves"]
        against = f"; one FE solve takes {duration(solve)}, {float(f'{solve / step:.2g}'):.0f} times as long"
    return [
        f"goals reached:      {found['reached']} of {found['goals']} on {name}, judged by the FE robot",
        f"tracking error:     {error}",
        f"time per step:      {duration(step)}{against}",
    ]


def _learned(trajectories: Mapping[str, Mapping[str, Any]]) -> tuple[str, Mapping[str, Any]]:
    name, controllers = next(iter(trajectories.items()))
    return name, next(one for who, one in controllers.items() if who != "fe-based" and "@" not in who)


def as_text(outcome: Mapping[str, Any]) -> str:
    """What is poor about the results, the three numbers and the pages."""
    results = outcome["results"]
    pages = [f"report:             {page}" for page in results["pages"]]
    pages += [f"robot to move:      {page}" for page in results["moved"]]
    return "\n".join([*sentences(results), *results["numbers"], *pages])
