"""Training, export and control, killed or interrupted at any moment: the artefact is the old one or the new one, whole,
and the next run ends with the numbers of one that nothing befell."""

import os
import random
import re
import shutil
import signal
import time
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from core.artefact.test_files import quick
from faults.processes import as_command, processes, stage
from surrogate.stored import store_dataset

from cfem.core.artefact.manifest import read_manifest
from cfem.core.artefact.verify import judge

__all__ = ["quick"]
ROOT = Path(__file__).parents[2]
MODELS = {
    "spectral": ("{kind: spectral, max_degree: 3}", "model.max_degree=2"),
    "mlp": ("{kind: mlp, width: 16, depth: 2, epochs: 20, device: cpu}", "model.seed=1"),
}


@dataclass(frozen=True)
class Command:
    """other: what of its spec is changed so that its artefact is another."""

    package: str
    spec: Path
    other: str

    def arguments(self, turn: int, out: Path) -> tuple:
        return self.package, self.spec, [self.other] if turn else [], out


@pytest.fixture(scope="module")
def commands(tmp_path_factory):
    root = tmp_path_factory.mktemp("commands")
    store_dataset(root / "samples")
    found = {}
    for name, (model, other) in MODELS.items():
        spec = root / f"{name}.yaml"
        spec.write_text(f"dataset: samples\nout: none\nmodel: {model}\n")
        found[name] = Command("surrogate", spec, other)
    stage("surrogate", root / "spectral.yaml", [], root / "model")
    (root / "export.yaml").write_text("model: model\nout: none\nformats: [arrays, onnx, torchscript]\n")
    for name, other in (("export", "formats=[arrays, onnx]"), ("export-c", "formats=[arrays, c]")):
        found[name] = Command("export", root / "export.yaml", other)
    return found


@pytest.fixture(scope="module")
def control(tmp_path_factory):
    """Of the smallest robot."""
    bar = tmp_path_factory.mktemp("control") / "pipelines" / "bar"
    shutil.copytree(ROOT / "pipelines" / "bar", bar)
    folders = {"robot": ("scene", "data"), "sample": ("sample", "data"), "surrogate": ("train", "models")}
    made = {"robot": "mesh", "sample": "samples", "surrogate": "spectral", "export": "spectral-export"}
    for package, (spec, folder) in (folders | {"export": ("export", "models")}).items():
        stage(package, bar / f"{spec}.yaml", [], bar.parents[1] / folder / "bar" / made[package])
    return Command("control", bar / "control.yaml", "trajectories.swing.goals=5")


def numbers(out):
    """What has to be the same, however often a run was cut short: the content hash, or, where threads of a solver
    round differently each time, positions in mm."""
    manifest = read_manifest(out)
    if manifest["stage"] != "control":
        return manifest["content"]
    return np.round(pq.read_table(out / "trajectories.parquet").flatten()["x_e"].combine_chunks().flatten(), 3).tolist()


def befall(command, folder, chance, times, harm):
    """Makes an artefact and, in turns, the other of the command's two, until `harm(child, said, seconds)` has cut it
    short so many times; exit codes and what was said. seconds: at random within what a run takes."""
    out, said, wholes, longest = folder / "out", folder / "said", [], float("inf")
    for turn in range(2):
        begin = time.monotonic()
        child = start(command.arguments(turn, folder / f"whole-{turn}"), said)
        child.join()
        assert child.exitcode == 0, said.read_text() if said.exists() else ""
        longest = min(longest, time.monotonic() - begin)
        wholes.append(numbers(folder / f"whole-{turn}"))
    assert wholes[0] != wholes[1]
    done = turn = 0
    while done < times:
        turn, code = 1 - turn, None
        while code != 0:
            child = start(command.arguments(turn, out), said)
            if done < times:
                harm(child, said, chance.uniform(0.0, longest))
            child.join()
            code = child.exitcode
            done += code != 0
            yield code, said.read_text() if said.exists() else ""
            if out.exists():
                assert judge(out).damage == () and numbers(out) in wholes
            else:  # before the first, or between the two renames
                assert code != 0
        assert numbers(out) == wholes[turn]
        assert {path.name for path in folder.glob(".out*")} == {".out.lock"}


def start(arguments, said):
    said.unlink(missing_ok=True)
    child = processes().Process(target=as_command, args=(stage, arguments, said))
    child.start()
    return child


def kill(child, said, seconds):
    child.join(seconds)
    child.kill()


SHORT, LONG = (
    {"spectral": 1, "mlp": 1, "export": 1},
    {"spectral": 60, "mlp": 70, "export": 160, "export-c": 40},
)


def few_and_many(few, many):
    return [pytest.param(name, count) for name, count in few.items()] + [
        pytest.param(name, count, marks=pytest.mark.slow) for name, count in many.items()
    ]


def command_named(name, request):
    return request.getfixturevalue("control") if name == "control" else request.getfixturevalue("commands")[name]


@pytest.mark.parametrize("name, kills", few_and_many(SHORT, LONG | {"control": 40}))
def test_killed_at_random_moments(request, quick, name, kills):
    codes = [code for code, _ in befall(command_named(name, request), quick, random.Random(kills), kills, kill)]
    assert set(codes) <= {0, -signal.SIGKILL} and codes.count(-signal.SIGKILL) == kills
    print(f"{name}: {kills} kills, {codes.count(0)} runs to the end")


@pytest.mark.parametrize(
    "name, times",
    few_and_many({"spectral": 1, "export": 1}, {"mlp": 60, "export": 60, "control": 40}),
)
def test_interrupted_at_random_moments(request, quick, name, times):
    signals = cycle([signal.SIGINT, signal.SIGTERM])

    def interrupt(child, said, seconds):
        while not said.exists():
            assert child.is_alive()
            time.sleep(0.001)
        child.join(seconds)
        if child.is_alive():
            os.kill(child.pid, next(signals))

    outcomes = list(befall(command_named(name, request), quick, random.Random(times), times, interrupt))
    assert {code for code, _ in outcomes} == {0, 130}, outcomes
    for code, said in outcomes:
        if code == 130:
            *before, last = said.splitlines()
            assert last == "cfem: interrupted; finished stages, samples and goals are kept: run the same command again"
            assert all(re.match(r"control: going on after \d+ of \d+ goals", line) for line in before)
    codes = [code for code, _ in outcomes]
    print(f"{name}: {times} signals, {codes.count(130)} exits with 130, {codes.count(0)} runs to the end")
