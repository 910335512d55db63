"""`make surrogates` makes what its page reads."""

import os
import re
import subprocess
from pathlib import Path

from cfem.core.spec import load_spec
from cfem.report.spec import ReportSpec
from cfem.report.stage import artefacts
from cfem.robot.spec import SceneSpec
from cfem.sample.spec import SampleSpec

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "pipelines" / "surrogates" / "report.yaml"


def test_the_page_reads_what_the_commands_before_it_make():
    command = ["make", "--dry-run", "--old-file=.venv/all", "surrogates"]
    environment = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "MAKELEVEL")}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    commands = done.stdout.replace("\\\n", " ")
    made = set(re.findall(r"--out (\S+)", commands))
    for sampled in re.findall(r"sample (pipelines/\S+)(?!.*--out)", commands):
        made.add(os.path.relpath(ROOT / Path(sampled).parent / load_spec(ROOT / sampled, SampleSpec).out, ROOT))
    read = {os.path.relpath(path, ROOT) for path in artefacts(load_spec(PAGE, ReportSpec), PAGE.parent).values()}
    assert read <= made and len(read) > 30


def test_states_out_of_reach_are_of_the_scenes_with_another_reach():
    study = (PAGE.parent / "study.mk").read_text()
    for robot, reach in re.findall(r"^REACH-(\S+) := (\d+) \d+", study, re.MULTILINE):
        scene = load_spec(ROOT / "pipelines" / robot / "scene.yaml", SceneSpec)
        assert {float(actuator.reach[1]) for actuator in scene.actuators} == {float(reach)}
