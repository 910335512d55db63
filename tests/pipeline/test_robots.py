"""`cfem init --robot`: the robots that come with cfem, in an empty folder."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.pipeline.plan import own_specs, plan
from cfem.pipeline.robots import ROBOTS, copy_robot, robots

SHOWN = [
    "bar",
    "bellows",
    "diamond",
    "fin-ray",
    "mckibben",
    "parametric-finger",
    "pneunet",
    "pneunet-trunk",
    "soft-finger",
    "soft-gripper",
    "stiff-flop",
    "three-chamber-gripper",
    "trunk",
]


def init(tmp_path, *words):
    return CliRunner().invoke(app, ["init", *words, "--folder", str(tmp_path / "pipelines")])


def test_the_packaged_robots_are_those_of_the_checkout():
    assert set(SHOWN) <= set(robots()) and not {"surrogates", "stiff-flop-experiments"} & set(robots())
    assert ROBOTS.samefile(Path(__file__).parents[2] / "pipelines")


@pytest.fixture(scope="module", params=robots())
def copied(request, tmp_path_factory):
    """A robot, the folder where it is called `mine`, and the files that were copied."""
    folder = tmp_path_factory.mktemp(request.param)
    return request.param, folder, copy_robot(request.param, "mine", folder / "pipelines")["files"]


def test_every_robot_can_be_run_under_another_name(copied):
    robot, folder, _ = copied
    steps = plan(own_specs(folder / "pipelines" / "mine"), {})
    outs = [step.stage.out.resolve().relative_to(folder).parts for step in steps]
    own = [out for out, step in zip(outs, steps, strict=True) if step.spec.parent.name == "mine"]
    assert all(out[0] in ("data", "models") and out[1] == "mine" for out in own) and own
    assert not any(out[1] == robot for out in outs)


def test_what_is_printed_can_be_done_and_editors_find_the_schemas(tmp_path):
    done = init(tmp_path, "my-finger", "--robot", "soft-finger")
    assert done.exit_code == 0, done.stderr
    assert (
        done.stdout.splitlines()[-1] == f"next: cfem run {tmp_path}/pipelines/my-finger" and "make " not in done.stdout
    )
    for path in (tmp_path / "pipelines" / "my-finger").glob("*.yaml"):
        schema = path.read_text().splitlines()[0].partition("$schema=")[2]
        text = json.loads((path.parent / schema).read_text())
        assert text.get("type") == "object" or text["oneOf"]
    check = CliRunner().invoke(app, ["run", str(tmp_path / "pipelines" / "my-finger"), "--check"])
    assert check.exit_code == 5 and "7 of 7 stages are stale" in check.stderr


def test_specs_that_somebody_edited_are_kept(tmp_path):
    init(tmp_path, "mine", "--robot", "bar")
    scene = tmp_path / "pipelines" / "mine" / "scene.yaml"
    edited = scene.read_text() + "# years\n"
    scene.write_text(edited)
    refused = init(tmp_path, "mine", "--robot", "bar")
    assert refused.exit_code == 6 and "scene.yaml: exists" in refused.stderr and scene.read_text() == edited
    assert init(tmp_path, "mine", "--robot", "bar", "--force").exit_code == 0
    assert scene.with_name("scene.yaml.old-1").read_text() == edited and "# years" not in scene.read_text()


@pytest.mark.parametrize(
    "words, said",
    [
        (["x", "--robot", "finger"], "use one of bar, bellows, crawler"),
        (["x"], "give --from FILE or --robot NAME"),
        (["x", "--robot", "bar", "--from", "x.step"], "one of the two"),
        (["x", "--robot", "bar", "--young", "1 MPa"], "--young goes with --from"),
        (["X Y", "--robot", "bar"], "small letters, digits and hyphens"),
    ],
)
def test_words_that_do_not_go_together_are_refused(tmp_path, words, said):
    done = init(tmp_path, *words)
    assert done.exit_code == 2 and said in done.stderr and not (tmp_path / "pipelines").exists()


def test_the_comments_of_a_copied_scene_name_no_file_that_was_not_copied(copied):
    files = {Path(path) for path in copied[2]}
    for path in files:
        if path.name == "scene.yaml" and path.parent.name == "mine":
            named = re.findall(r"\b(\w[\w-]*\.yaml)\b", "".join(re.findall(r"#[^\n]*", path.read_text())))
            assert {path.with_name(name) for name in named if not name.startswith("yaml-")} <= files
