"""Specs that nobody means well: a documented exit code and one sentence, never a defect of ours."""

import copy
import json
import os
import random
from pathlib import Path

import pytest
from faults.from_schema import specs
from hypothesis import HealthCheck, given, settings
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.files import content_sha256
from cfem.core.artefact.manifest import MANIFEST, write_manifest
from cfem.core.errors import EXIT_CODES
from cfem.core.yaml import read_yaml

ROOT = Path(__file__).parents[2]
COMMANDS = {
    "scene": "mesh",
    "sample": "sample",
    "train": "train",
    "export": "export",
    "control": "control",
    "calibrate": "calibrate",
    "design": "optimize-design",
    "report": "report",
}
ODD = [
    None, True, False, 0, -1, 1, 2, 10**9, 10**400, 1e308, -0.0, 1e-320, "nan", "inf", ".nan", ".inf", "", " ", "x",
    "3 mm", "-3 mm", "1e999 mm", "nan mm", "3 kPa", "0 mm", "1e-300 m", "3 mm/0", "1/0 mm", "__import__('os')", "3",
    "../../../etc/passwd", "/dev/zero", "/", ".", "..", "a/../b", "\x00", "\ud7ff", "é" * 1000, "9" * 5000, "{}", "*",
    "%s%n", "${HOME}", "~", "3**3**9 mm", "x" * 100_000, [], {}, [[]], [None], {"": ""}, {"mm": []}, {"mm": [[0, 0]]},
    {"mm": "x"}, {"kPa": [1, 2]}, {"mm": 1, "m": 2}, {"mm": [1e400, 2]}, {"mm": [[0, 0, 0], [0, 0]]}, {"kind": "cable"},
    {"kind": None}, {"kind": []}, [[[[[[[[[[1]]]]]]]]]], [float("nan")], float("inf"),
]  # fmt: skip


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    """All pipelines, and in the place of everything that they read an artefact that only its manifest makes one."""
    root = tmp_path_factory.mktemp("project")
    specs = []
    for path in sorted(ROOT.glob("pipelines/*/*.yaml")):
        kind = path.stem.split("-")[0]
        if kind not in COMMANDS:
            continue
        target = root / path.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(path.read_text())
        data = read_yaml(path)[0]
        specs.append((COMMANDS[kind], target, data))
        for text in _strings(data):
            if text.startswith("../../data/") or text.startswith("../../models/"):
                folder = (target.parent / text).resolve()
                folder.mkdir(parents=True, exist_ok=True)
                write_manifest(folder, {"stage": "x", "content": content_sha256(text), "files": {}, "results": {}})
    return specs


def _strings(node):
    if isinstance(node, dict | list):
        for item in node.values() if isinstance(node, dict) else node:
            yield from _strings(item)
    elif isinstance(node, str):
        yield node


def mutated(data, chance, others):
    """A copy of a spec with one to four wrong places."""
    data = copy.deepcopy(data)
    for _ in range(chance.choice([1, 1, 1, 2, 4])):
        node, places = data, []
        while isinstance(node, dict | list) and node:
            key = chance.choice(list(node) if isinstance(node, dict) else range(len(node)))
            places.append((node, key))
            node = node[key]
        if not places:
            return data
        parent, key = chance.choice(places)
        match chance.randrange(7):
            case 0:
                del parent[key]
            case 1 if isinstance(parent, dict):
                parent[str(key) + chance.choice(["x", " ", ".", "/../y", "\n"])] = parent.pop(key)
            case 2 if isinstance(parent, list):
                parent.extend([copy.deepcopy(parent[key])] * chance.choice([1, 3, 50]))
            case 3:
                parent[key] = copy.deepcopy(_subtree(chance.choice(others), chance))
            case 4 if type(parent[key]) in (int, float) and abs(parent[key]) < 1e300:
                parent[key] = parent[key] * chance.choice([-1, 0, 1e-12, 1e12, 0.5])
            case _:
                parent[key] = copy.deepcopy(chance.choice(ODD))
    return data


def _subtree(node, chance):
    while isinstance(node, dict | list) and node and chance.random() < 0.7:
        node = chance.choice(list(node.values()) if isinstance(node, dict) else node)
    return node


def garbled(text, chance):
    """YAML with some characters gone, doubled or changed."""
    for _ in range(chance.choice([1, 2, 5, 20])):
        at = chance.randrange(len(text))
        piece = chance.choice(
            ["", "", "&a ", "*a", "!!python/object:os.system ", "\t", ": ", "- ", "{", "]", "'", "\x07", "|"]
        )
        text = text[:at] + piece + text[at + chance.choice([0, 1, 7]) :]
    return text


@pytest.mark.parametrize("count", [21, pytest.param(10_000, marks=pytest.mark.slow)])
def test_mutated_specs_end_with_a_documented_code(project, count):
    chance = random.Random(count)
    others = [data for _, _, data in project]
    codes, bad = dict.fromkeys(EXIT_CODES, 0), []
    for number in range(count):
        command, path, data = chance.choice(project)
        text = (
            json.dumps(mutated(data, chance, others))
            if number % 3
            else garbled((ROOT / "pipelines" / path.parent.name / path.name).read_text(), chance)
        )
        code, wrong = outcome(command, path.with_name(f"hostile-{number}.yaml"), text)
        codes[code] = codes.get(code, 0) + 1
        bad += wrong
    print({code: times for code, times in codes.items() if times})
    assert not bad, f"{len(bad)} of {count}; the first: {bad[0]}"


@pytest.mark.parametrize("count", [3, pytest.param(1250, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", COMMANDS)
def test_specs_drawn_from_the_schemas_end_with_a_documented_code(project, kind, count):
    schema = json.loads((ROOT / "schemas" / f"{kind}.json").read_text())
    folder = next(path.parent for _, path, _ in project if path.parent.name == "soft-finger")
    artefacts = sorted({os.path.relpath(path.parent, folder) for path in folder.parents[1].rglob(MANIFEST)})
    codes = dict.fromkeys(EXIT_CODES, 0)

    @settings(
        max_examples=count, derandomize=True, database=None, deadline=None, suppress_health_check=list(HealthCheck)
    )
    @given(specs(schema, ["scene.yaml", *artefacts]))
    def try_one(spec):
        code, wrong = outcome(COMMANDS[kind], folder / "hostile.yaml", json.dumps(spec))
        codes[code] += 1
        assert not wrong

    try_one()
    print(kind, {code: times for code, times in codes.items() if times})


def outcome(command, path, text):
    """Exit code of the command on a spec of this text, and what is wrong with how it ended, none or one."""
    path.write_bytes(text.encode(errors="replace"))
    result = CliRunner().invoke(app, [command, str(path), "--check"])
    path.unlink()
    said = [
        line for line in result.stderr.strip().splitlines() if not line.endswith(" so far")
    ]  # a busy machine: progress
    one = len(said) == 1 and len(result.stderr) < 4000
    fine = result.exit_code in (0, 2, 3, 5) and (one or not result.exit_code)
    return result.exit_code, [] if fine else [(command, result.exit_code, result.stderr[-300:], text[-3000:])]
