"""Work of `cfem stability`: choose cases, run them, and say what came of it."""

from pathlib import Path

from cfem.core.console.progress import progress
from cfem.core.errors import SpecError
from cfem.stability.case import Case
from cfem.stability.families import built_in
from cfem.stability.suite import Result, chosen, run_all


def select(scene: Path | None = None, only: str | None = None, heavy: bool = False) -> list[Case]:
    """Cases on built-in bodies, and on the scene's own mesh where one is given, whose names fit the pattern.

    Raises InputError where the scene or its mesh is missing, SpecError where no case is left."""
    cases = built_in()
    if scene is not None:
        from cfem.robot.load import load_scene_and_mesh
        from cfem.stability.families import scene as family

        cases += family.cases(*load_scene_and_mesh(scene))
    left = chosen(cases, only, heavy)
    if not left:
        raise SpecError(f"no case matches '{only}'", do="cfem stability --list names them")
    return left


def run_cases(cases: list[Case]) -> list[Result]:
    with progress("cases", len(cases)) as advance:
        return run_all(cases, advance)
