"""What CI runs is pinned to commits, may only read, and is in the Makefile or in scripts."""

import re
from pathlib import Path

import pytest

from cfem.core.yaml import read_yaml

ROOT = Path(__file__).parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_is_pinned_and_runs_targets_that_exist(path):
    workflow, _ = read_yaml(path)
    assert workflow["permissions"] == {"contents": "read"}
    targets = set(re.findall(r"^([^\s:#=]+):(?!=)", (ROOT / "Makefile").read_text(), re.MULTILINE))
    makes, scripts = [], []
    for job in workflow["jobs"].values():
        assert job["timeout-minutes"] <= 60
        for step in job["steps"]:
            assert re.fullmatch(r"[\w./-]+@[0-9a-f]{40}", step.get("uses", "a@" + 40 * "0")), step
            makes += re.findall(r"make (\S+)", step.get("run", ""))
            scripts += re.findall(r"python (\S+)", step.get("run", ""))
    assert makes + scripts and set(makes) <= targets
    assert all((ROOT / script).is_file() for script in scripts)
