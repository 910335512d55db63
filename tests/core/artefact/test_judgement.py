"""What nobody should trust is said first, is repeated by all that is made from it, and decides the exit code."""

import pytest

from cfem.core.artefact.judgement import contradicted, demand_trust, poor, sentences
from cfem.core.artefact.manifest import read_manifest
from cfem.core.artefact.stage_run import Stage
from cfem.core.errors import NumericalError
from cfem.core.spec import Spec
from cfem.core.stage import Options, run_stage


class Nothing(Spec):
    pass


def made(folder, name, results, **inputs):
    return run_stage(Stage(name, 1, Nothing(), inputs, folder / name), lambda _: results, Options())["results"]


def test_a_judgement_goes_along_the_chain_once(tmp_path):
    made(tmp_path, "sample", {"judgement": [poor("12 of 24 states failed")]})
    made(tmp_path, "train", {"judgement": [poor("loss 4.6")], "answer": 1}, samples=tmp_path / "sample")
    last = made(tmp_path, "control", {"answer": 2}, model=tmp_path / "train", samples=tmp_path / "sample")
    assert sentences(last) == [
        "POOR input, by cfem train: loss 4.6",
        "POOR input, by cfem sample: 12 of 24 states failed",
    ]
    assert next(iter(read_manifest(tmp_path / "control")["results"])) == "judgement"


def test_what_is_sound_says_nothing(tmp_path):
    plain = tmp_path / "plain.txt"
    plain.write_text("a file without a manifest")
    assert made(tmp_path, "mesh", {"answer": 1}, file=plain) == {"answer": 1}
    made(tmp_path, "sample", {"judgement": []}, mesh=tmp_path / "mesh")
    assert made(tmp_path, "train", {}, samples=tmp_path / "sample") == {}


def test_poor_results_fail_when_strict_and_contradicted_ones_always():
    demand_trust({}, strict=True)
    demand_trust({"judgement": [poor("loss 1")]}, strict=False)
    for judged, strict in ((poor("loss 1"), True), (contradicted("FE finds otherwise"), False)):
        with pytest.raises(NumericalError, match=judged["what"]):
            demand_trust({"judgement": [judged]}, strict)


@pytest.mark.parametrize("found", [None, "text", [1], [{"what": 3}], {"what": "x"}])
def test_a_manifest_from_elsewhere_may_hold_anything(found):
    assert sentences({"judgement": found}) == []
