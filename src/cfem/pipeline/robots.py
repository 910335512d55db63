"""The robots that come with cfem, as folders of specs to copy."""

import re
from pathlib import Path
from typing import Any

from cfem.core.artefact.place import write_beside
from cfem.core.errors import OutputError, SpecError
from cfem.core.names import demand_scene_name
from cfem.pipeline.plan import own_specs, plan

ROBOTS = Path(__file__).parents[1] / "pipelines"


def robots() -> list[str]:
    """Names of those that can be run as they are: their folder has a scene, or trains a model."""
    return sorted({path.parent.name for kind in ("scene", "train") for path in ROBOTS.glob(f"*/{kind}.yaml")})


def copy_robot(robot: str, name: str, folder: Path, force: bool = False) -> dict[str, Any]:
    """Writes the specs of `robot` to folder / name, with results under that name, and beside it those of other robots
    that it needs and that are not there yet. Returns folder and files. SpecError where there is no such robot;
    OutputError where specs are there and not `force`."""
    if robot not in robots():
        raise SpecError(f"there is no robot '{robot}'", where="--robot", do=f"use one of {', '.join(robots())}")
    demand_scene_name(name)
    texts: dict[Path, str] = {}
    for step in plan(own_specs(ROBOTS / robot), {}):
        of_this_robot = step.spec.parent.name == robot
        target = folder / (name if of_this_robot else step.spec.parent.name) / step.spec.name
        text = step.spec.read_text(encoding="utf-8")
        if of_this_robot or not target.exists():
            texts[target] = renamed(text, robot, name) if of_this_robot else text
        for file in sorted(step.spec.parent.iterdir()):  # measurements with their licence, objectives
            if file.is_file() and file.suffix != ".yaml":
                texts.setdefault(target.with_name(file.name), file.read_text(encoding="utf-8"))
    changed = [path for path, text in texts.items() if path.exists() and path.read_text(encoding="utf-8") != text]
    if changed and not force:
        raise OutputError("exists", where=str(changed[0]), do="choose another name, or --force, which keeps a copy")
    for path, text in texts.items():
        write_beside(path, text.encode())
    return {"folder": str(folder / name), "files": [str(path) for path in texts]}


def renamed(text: str, robot: str, name: str) -> str:
    """A spec whose scene and results are called `name`."""
    text = re.sub(rf"^name: {re.escape(robot)}$", f"name: {name}", text, flags=re.MULTILINE)
    return re.sub(rf"\b(data|models)/{re.escape(robot)}/", rf"\1/{name}/", text)
