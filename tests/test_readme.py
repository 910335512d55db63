"""The README and the pages state what was measured, and name what exists."""

import json
import re
from pathlib import Path

import pytest
from support.script import script

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


@pytest.fixture(scope="module")
def figures():
    return script("figures")


def test_the_tables_are_those_of_the_measured_figures(figures):
    measured = json.loads(figures.FIGURES.read_text())
    for name in figures.FILES:
        text = (ROOT / name).read_text()
        assert figures.with_tables(text, measured) == text


def test_every_file_and_target_that_it_names_exists():
    for path in re.findall(r"[(\"](docs/[^)\"]+)", README):
        assert (ROOT / path).exists(), path
    known = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    known |= {path.parent.name for path in ROOT.glob("pipelines/*/report.yaml")} | {"my-robot"}
    for name in re.findall(r"make ([a-z-]+)", README):
        assert name in known, name


def test_the_example_robots_are_valid_scenes(tmp_path):
    from cfem.core.spec import load_spec
    from cfem.robot.spec import SceneSpec

    examples = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "scenes.md").read_text(), re.DOTALL)
    whole, more, cad, layers, contact, pneunet, pneunet_trunk, bellows, muscle, fin_ray, form = examples
    path = tmp_path / "scene.yaml"
    path.write_text(whole)
    assert load_spec(path, SceneSpec).name == "my-robot"
    path.write_text(whole.split("actuators:")[0] + form + more + "effectors:" + whole.split("effectors:")[1])
    scene = load_spec(path, SceneSpec)
    path.write_text(re.sub("geometry:.*\n", cad, whole))
    assert load_spec(path, SceneSpec).materials[0].region.name == "solid-2"
    assert len(scene.materials) == len(scene.rigid) == 1 and scene.actuators[0].name == "chamber"
    assert len(scene.shape.controls) == 2 and scene.shape.walls[0].thicker == 0.4
    path.write_text(layers + contact + re.sub("geometry:.*\n", pneunet, whole))
    scene = load_spec(path, SceneSpec)
    for kind, text in (("pneunet-trunk", pneunet_trunk), ("bellows", bellows), ("tube", muscle)):
        path.write_text(re.sub("geometry:.*\n", text, whole))
        assert load_spec(path, SceneSpec).geometry.kind == kind
    path.write_text(whole.split("geometry:")[0] + fin_ray + "mesh:" + whole.split("mesh:")[1].split("actuators:")[0])
    with path.open("a") as file:
        file.write("effectors:\n  - {name: tip, at: tip}\n")
    assert load_spec(path, SceneSpec).actuators[0].kind == "push"
    assert scene.geometry.kind == "pneunet" and len(scene.layers) > 1 and scene.self_contact.within == 3.0
