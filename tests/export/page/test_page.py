"""The file of a page, without a browser: what is inside, and what is refused."""

import re

import numpy as np
import pytest
from export.embedded import network, serial, spectral
from export.page.test_data import unpacked
from export.pages import ROBOTS, page_of, skin_of

from cfem.core.errors import InputError
from cfem.export.firmware.at_rest import right_at_rest, with_rest
from cfem.export.firmware.embedding import Embedding
from cfem.export.page.data import Packed
from cfem.export.page.page import page
from cfem.export.spec import CSpec
from cfem.predict.load import build


def content(text: str) -> tuple[dict, dict[str, bytes]]:
    found = re.search(r'<script id="robot"[^>]*data-bytes="(\d+)" data-crc="(\d+)">([^<]*)</script>', text)
    return unpacked(Packed(found[3], int(found[1]), int(found[2])))


@pytest.mark.parametrize("name", ROBOTS)
def test_it_is_one_file_that_asks_for_nothing(name):
    text = page_of(name)
    assert len(text) < 250_000
    assert not re.search(r"""(src|href)=|https?:|url\(|@import|fetch\(""", text)
    assert "{{" not in text and "}}" not in re.sub(r"<script>.*?</script>|<style>.*?</style>", "", text, flags=re.S)
    said, arrays = content(text)
    assert arrays["code"][:4] == b"\0asm" and said["points"] == [{"name": "tip", "rows": [0, 3]}]


def test_it_is_the_same_for_the_same_model():
    assert page_of("two cables") == page_of("two cables")


def test_names_are_text():
    meta, arrays = spectral()
    meta = {**meta, "scene": "<b>&", "rows": {**meta["rows"], "actuators": ["</script>", "a&b"]}}
    text = page(meta, arrays, skin_of(meta, arrays), CSpec(), Embedding())
    assert "<title>&lt;b&gt;&amp;</title>" in text and text.count("</script>") == 2
    assert content(text)[0]["actuators"][0]["name"] == "</script>"


def test_what_is_poor_about_the_model_is_said_first():
    meta, arrays = spectral()
    text = page(meta, arrays, skin_of(meta, arrays), CSpec(), Embedding(), ["POOR input: the cells hold <10 %> less"])
    said = '<p class="poor">POOR input: the cells hold &lt;10 %&gt; less</p>'
    assert 0 < text.index("<h1>") < text.index(said) < text.index('id="status"')


def test_stated_pressures_bound_the_forces():
    meta, arrays = serial()
    pressures = np.tile([0.0, 0.2], (6, 1))
    text = page(meta, arrays, skin_of(meta, arrays), CSpec(), Embedding(pressures))
    assert content(text)[0]["actuators"][0]["lambda"] == [0.0, 0.2]


def test_a_push_is_no_cable():
    meta, arrays = spectral()
    left, right = meta["rows"]["actuators"]
    cable = {"kind": "cable", "name": left, "points": [[0.0, 0, -20], [0.0, 0, -80]]}
    robot = {"geometry": {"kind": "step"}, "actuators": [cable, {"kind": "push", "name": right}]}
    text = page({**meta, "robot": robot}, arrays, skin_of(meta, arrays), CSpec(), Embedding())
    pulled, pushed = content(text)[0]["actuators"]
    assert (pulled["kind"], pushed["kind"]) == ("cable", "push")
    assert (pushed["unit"], pushed["forceUnit"]) == ("mm", "N")


def test_rest_is_among_the_known_states_where_the_model_is_right_there():
    meta, arrays = spectral()
    predictor = build(meta, arrays)
    names = ("delta_a", "lambda_a", "along")
    box = {f"cfem_domain_{name}": np.array([[1.0, 2.0], [9.0, 8.0]]) for name in names}
    box["cfem_domain_axes"] = np.eye(2)
    assert right_at_rest(predictor, box, np.zeros(0))
    wide = with_rest(predictor, box, np.zeros(0))
    assert len(wide) == 3 and all(np.abs(one - [[0.0, 0.0], [9.0, 8.0]]).max() < 1e-3 for one in wide.values())
    shifted = arrays["series"].copy()
    gradient = slice(1, 1 + predictor.rows.n_a)  # behind the energy
    shifted[gradient, (arrays["indices"] == 0).all(axis=1)] += 1.0  # forces without any displacement
    assert not right_at_rest(build(meta, arrays | {"series": shifted}), box, np.zeros(0))


def test_what_the_page_has_no_room_for_is_refused():
    meta, arrays = spectral()
    skin = skin_of(meta, arrays)
    thick = {"modes": np.zeros((41, *skin["rest"].shape)), "series": np.ones((41, len(skin["indices"])))}
    with pytest.raises(InputError, match="40 modes"):
        page(meta, arrays, skin | thick, CSpec(), Embedding())
    with pytest.raises(InputError, match="no goal to drag"):
        rows = {"effectors": ["a.x", "b.y", "c.z"], "actuators": meta["rows"]["actuators"]}
        page({**meta, "rows": rows}, arrays, skin, CSpec(), Embedding())
    with pytest.raises(InputError, match="mlp"):
        page(*network(), skin, CSpec(), Embedding())
