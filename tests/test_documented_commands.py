"""Every command that README and pages state exists: its options, its spec, and the keys that it overrides."""

import re
import shlex
from pathlib import Path

import pytest
import typer
from test_benchmarks import LONG, QUICK

from cfem.cli.app import app
from cfem.core.kinds import KINDS, model_of
from cfem.core.spec import load_spec
from cfem.pipeline.plan import own_specs

ROOT = Path(__file__).parents[1]
FIRMWARE = ROOT / "src/cfem/export/firmware/sources"
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
GROUP = typer.main.get_command(app)
STAGES = {command: kind for kind, (_, _, command) in KINDS.items()} | {"sample": "sample", "merge": "sample"}
# What a reader puts in: names in capitals, and the robots and files of the examples.
KIND = "scene|sample|train|export|control|calibrate|estimate|measurements|cases|predict|design|report"
SPEC = rf"({KIND})(-(c|large|mlp))?\.yaml"
OWN = re.compile(rf"[A-Z]{{2,}}|\.\.\.|my-|s-arm|<|=[A-Z]$|^{SPEC}|^\.\./|host")


def blocks(text: str) -> list[str]:
    """Lines of code blocks, a command that goes on over several lines as one."""
    fenced = re.findall(r"```(?:sh|bash|console)?\n(.*?)```", text, re.DOTALL)
    indented = re.findall(r"(?:^ {4,}\S.*\n?)+", re.sub(r"```.*?```", "", text, flags=re.DOTALL), re.MULTILINE)
    found = []
    for block in (*fenced, *indented):
        pending = ""
        for line in block.splitlines():
            pending = f"{pending} {line.strip()}".strip()
            if pending.endswith("\\"):
                pending = pending[:-1]
            elif pending.count('"') % 2 == 0 and pending.count("'") % 2 == 0:
                found.append(pending)
                pending = ""
    return found


def commands(page: Path) -> list[str]:
    text = page.read_text()
    inline = [
        " ".join(code.split()) for code in re.findall(r"`([^`]+)`", re.sub(r"```.*?```", "", text, flags=re.DOTALL))
    ]
    starts = ("cfem ", "make ", "python benchmarks/", "python scripts/", "benchmarks/")
    return [one for one in (*blocks(text), *inline) if one.startswith(starts)]


CASES = [pytest.param(one, id=f"{page.stem}: {one[:70]}") for page in PAGES for one in dict.fromkeys(commands(page))]


def test_the_pages_state_commands():
    assert len(CASES) > 100


@pytest.mark.parametrize("command", CASES)
def test_a_stated_command_exists(command):
    words = shlex.split(command, comments=True)
    if words[0] == "make":
        known = set(re.findall(r"^([a-z][a-z-]*|\.venv/[a-z]+):", makefiles(), re.MULTILINE)) | pipelines()
        assert all(word in known or OWN.search(word) or "=" in word for word in targets(words)), words
    elif words[0] == "cfem":
        cfem(words[1:])
    else:
        script = next(word for word in words if word.startswith(("benchmarks/", "scripts/")))
        assert (ROOT / script).exists()
        if script.startswith("benchmarks/") and not Path(script).name.startswith("test_"):
            assert Path(script).name in {one.split()[0] for one in (*QUICK, *LONG)}


def makefiles() -> str:
    return "\n".join(
        path.read_text()
        for path in (
            ROOT / "Makefile",
            *ROOT.glob("pipelines/*/*.mk"),
            ROOT / "src/cfem/export/firmware/sources/controller/Makefile",
        )
    )


def pipelines() -> set[str]:
    return {path.parent.name for path in ROOT.glob("pipelines/*/scene.yaml")} | {"clean"}


def targets(words: list[str]) -> list[str]:
    """What make is asked for; folders with Makefiles of their own have their own targets."""
    return [] if "-C" in words else [word for word in words[1:] if not word.startswith("-")]


def cfem(words: list[str]) -> None:
    if not words or words[0].startswith("-") or OWN.search(words[0]):
        return
    name, *rest = words
    assert name in GROUP.commands, f"cfem {name}"
    command = GROUP.commands[name]
    options = {flag: one for one in command.params for flag in (*one.opts, *one.secondary_opts)}
    overrides, arguments = [], []
    rest = iter([word for word in rest if word not in ("[--set", "[--json]")])
    for word in rest:
        flag = word.partition("=")[0]
        if not word.startswith("--"):
            arguments.append(word)
            continue
        assert flag.strip("[]") in options, f"cfem {name} has no {flag}"
        option = options[flag.strip("[]")]
        if not option.is_flag and "=" not in word:
            value = next(rest, "")
            if flag == "--set":
                overrides.append(value)
    if name == "run":
        places = [ROOT / one for one in arguments if not OWN.search(one)]
        goals = [spec for place in places for spec in (own_specs(place) if place.is_dir() else [place])]
        assert {one.partition(".")[0] for one in overrides if places} <= {goal.stem for goal in goals}, overrides
    if name in STAGES and arguments and not OWN.search(arguments[0]) and not any("$" in one for one in overrides):
        load_spec(ROOT / arguments[0], model_of(STAGES[name]), [one for one in overrides if not OWN.search(one)])
