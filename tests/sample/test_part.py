"""Parts that several machines solve are, joined, the dataset that one machine makes."""

import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from cfem.cli.app import app
from cfem.core.artefact.manifest import read_manifest
from cfem.core.errors import SpecError
from cfem.sample.part import SamplePart, parse_part

PIPELINE = Path(__file__).parents[2] / "pipelines" / "bar"
SMALL = [f"--set={text}" for text in ("splits.train.rows=10", "splits.test.rows=5", "skeleton=4", "shard=2")]


def cfem(*words):
    return CliRunner().invoke(app, [*map(str, words), "--quiet"])


@pytest.fixture(scope="module")
def spec(tmp_path_factory):
    """The bar's, with its mesh, the dataset that one run makes, and three parts."""
    root = tmp_path_factory.mktemp("bar")
    pipeline = shutil.copytree(PIPELINE, root / "pipelines" / "bar")
    path = pipeline / "sample.yaml"
    assert cfem("mesh", pipeline / "scene.yaml").exit_code == 0
    single = cfem("sample", path, *SMALL, "--out", root / "single", "--workers", 1)
    assert single.exit_code == 0, single.stderr
    for index in (1, 2, 3):
        found = cfem("sample", path, *SMALL, "--shard", f"{index}/3", "--workers", 1)
        assert found.exit_code == 0, found.stderr
    return path


@pytest.fixture
def data(spec):
    return spec.parents[2] / "data" / "bar"


def test_the_parts_together_are_the_whole(spec, data):
    single = read_manifest(spec.parents[2] / "single")
    found = CliRunner().invoke(app, ["merge", str(spec), *SMALL, "--json"])
    assert found.exit_code == 0, found.stderr
    merged = json.loads(found.stdout)
    assert merged["content"] == single["content"] and merged["made_from"] == single["made_from"]
    assert merged["results"]["rows"] == single["results"]["rows"] and merged["results"]["parts"] == 3
    shares = [read_manifest(data / f"samples-part-{i}-of-3")["results"]["rows"] for i in (1, 2, 3)]
    assert sum(shares) == 15 - 4 and min(shares) > 0
    assert cfem("sample", spec, *SMALL, "--check").exit_code == 0


def parts(data, *names):
    return [data / f"samples-part-{name}" for name in names]


def test_parts_that_are_missing_doubled_foreign_or_damaged_are_named(spec, data, tmp_path):
    def merge(*folders, words=SMALL):
        return cfem("merge", spec, *folders, *words, "--out", tmp_path / "out")

    one, two, three = parts(data, "1-of-3", "2-of-3", "3-of-3")
    assert "1 of 3 parts missing: 2/3" in merge(one, three).stderr
    assert "is part 1, and so is" in merge(one, two, three, one).stderr
    assert "is not a part" in merge(one, spec.parents[2] / "single").stderr
    other = [*SMALL[:-1], "--set=shard=3"]
    assert "part of another dataset" in merge(one, two, three, words=other).stderr
    assert "has no parts beside it" in merge().stderr
    bad = shutil.copytree(two, tmp_path / "bad")
    shard = next(bad.glob("shard-*.parquet"))
    shard.write_bytes(shard.read_bytes()[:-1])
    result = merge(one, bad, three)
    assert result.exit_code == 3 and shard.name in result.stderr and not (tmp_path / "out").exists()


def test_a_part_that_is_none_is_refused(spec):
    assert parse_part("2/8") == SamplePart(2, 8)
    for text in ("0/3", "4/3", "1", "1/0", "a/b", "1/2/3", "-1/2"):
        with pytest.raises(SpecError, match="not a part"):
            parse_part(text)
    result = cfem("sample", spec, *SMALL, "--shard", "1/2", "--until-error", "1mm")
    assert result.exit_code == 2 and "until" in result.stderr
