import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.cli.help import GROUPS
from cfem.core.kinds import KINDS

ROOT = Path(__file__).parents[2]
COMMANDS = typer.main.get_command(app).commands
SHOWN = [name for name, command in COMMANDS.items() if not command.hidden]


def help_of(*words):
    found = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "80"}, terminal_width=80)
    assert found.exit_code == 0
    return found.stdout


def test_every_command_stands_in_one_group_in_the_order_of_work():
    grouped = [name for names in GROUPS.values() for name in names]
    assert set(SHOWN) <= set(grouped) and len(set(grouped)) == len(grouped)
    lines = help_of().splitlines()
    places = [next(i for i, line in enumerate(lines) if line.startswith(f"  {n} ")) for n in grouped if n in SHOWN]
    assert places == sorted(places)


@pytest.mark.parametrize("command", ["", *SHOWN])
def test_help_fits_80_columns(command):
    assert max(map(len, help_of(*command.split()).splitlines())) <= 80


def test_no_summary_is_cut():
    text = " ".join(help_of().split())
    for name in SHOWN:
        assert " ".join(COMMANDS[name].help.split()) in text


@pytest.mark.parametrize("name", SHOWN)
def test_every_argument_and_option_is_explained(name):
    for one in COMMANDS[name].params:
        assert one.help, one.name


def test_the_shell_can_complete():
    code = "from cfem.__main__ import main; main()"
    asked = {"_CFEM_COMPLETE": "complete_bash", "COMP_WORDS": "cfem opt", "COMP_CWORD": "1", "PATH": ""}
    named = f"import sys; sys.argv = ['cfem']; {code}"
    found = subprocess.run([sys.executable, "-c", named], capture_output=True, text=True, env=asked)
    assert "optimize-design" in found.stdout


@pytest.mark.parametrize("name", [name for name in SHOWN if COMMANDS[name].epilog])
def test_a_stage_says_what_it_reads_and_its_example_is_there(name):
    said = COMMANDS[name].epilog
    assert said.startswith("Reads ") and " ".join(said.split()) in " ".join(help_of(name).split())
    _, _, example = said.partition("Example: cfem ")
    if example:
        command, path, *_ = example.split()
        assert command == name and (ROOT / path).is_file()


@pytest.mark.parametrize("name", [command for _, _, command in KINDS.values()])
def test_every_command_finds_its_stage(name, tmp_path):
    done = CliRunner().invoke(app, [name, str(tmp_path / "none.yaml")])
    assert done.exit_code in (2, 3) and "none.yaml" in done.stderr, done.output
