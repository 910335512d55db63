"""A model folder that is replaced again and again while others read it: no reader sees half a model."""

import shutil
import subprocess
import sys
import time

import numpy as np
import pytest
from surrogate.stored import train_folder

from cfem.core.artefact.replace import replace_folder
from cfem.core.errors import InputError
from cfem.core.system import exchange
from cfem.predict.load import LiveModel, load_model, read_vectors

WRITER = """
import shutil, sys, time
from pathlib import Path
from cfem.core.artefact.replace import replace_folder
target, *sources = map(Path, sys.argv[1:])
swaps = 0
while swaps <= 20 or not target.with_name("enough").exists():
    time.sleep(0.08 * (swaps % 3))  # once at once, then later than a busy reader takes
    new = target.with_name(".new")
    shutil.copytree(sources[swaps % 2], new)
    replace_folder(new, target)
    swaps += 1
print(swaps)
"""


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Two models of one robot, of different size."""
    made = []
    for name, degree in (("small", 4), ("large", 8)):
        place = tmp_path_factory.mktemp(name)
        made.append(train_folder(place, f"{{kind: spectral, max_degree: {degree}}}", train=60))
    return made


@pytest.mark.skipif(sys.platform != "linux", reason="one swap of two folders, as Linux has it")
def test_a_reader_sees_one_whole_model_or_the_other_at_any_moment(two, tmp_path):
    target = tmp_path / "model"
    shutil.copytree(two[1], target)
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(target), *map(str, two)], stdout=subprocess.PIPE, text=True
    )
    sizes, reads = set(), 0
    while writer.poll() is None:
        model = load_model(target)  # never missing, never damaged
        again = model.meta["terms"]
        assert len(model.arrays["indices"]) <= again["potential"] + sum(again.values())
        own = two[0] if again == load_model(two[0]).meta["terms"] else two[1]
        vectors = read_vectors(own, model.meta)
        np.testing.assert_allclose(model.evaluate(vectors["s"], None)[0], vectors["W"], rtol=1e-12, atol=1e-14)
        sizes.add(own)
        reads += 1
        if reads == 20:
            (tmp_path / "enough").touch()
    assert int(writer.communicate()[0]) > 20 <= reads and len(sizes) == 2


def test_the_last_good_model_answers_until_another_is_whole(two, tmp_path):
    target, at = tmp_path / "model", np.array([4.0, 3.0])
    shutil.copytree(two[0], target)
    live = LiveModel(target)
    answers = [load_model(one).at_displacement(at).delta_e for one in two]
    np.testing.assert_array_equal(live.at_displacement(at).delta_e, answers[0])
    assert not live.refresh()
    (target / "weights.npz").write_bytes(b"half")  # damaged in place
    (target / "manifest.json").touch()
    time.sleep(0.01)
    assert not live.refresh()
    np.testing.assert_array_equal(live.at_displacement(at).delta_e, answers[0])
    new = tmp_path / "new"
    shutil.copytree(two[1], new)
    replace_folder(new, target)
    assert live.refresh() and live.taken == 1 and not live.refresh()
    np.testing.assert_array_equal(live.at_displacement(at).delta_e, answers[1])
    assert live.rows == load_model(two[1]).rows
    shutil.rmtree(target)
    assert not live.refresh()
    with pytest.raises(InputError):
        LiveModel(target)


@pytest.mark.skipif(sys.platform != "linux", reason="as Linux has it")
def test_two_folders_change_places_in_one_step(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    assert exchange(tmp_path / "a", tmp_path / "b")
    assert (tmp_path / "a" / "b").exists() and (tmp_path / "b" / "a").exists()
    assert not exchange(tmp_path / "a", tmp_path / "missing")
