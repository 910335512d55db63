"""What a page says in a real browser where its data or its browser lack something: it draws nothing."""

import re

import pytest
from export.pages import browser, opened, page_of

CUT = "incomplete or damaged"


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """The page of a robot, written once."""
    path = tmp_path_factory.mktemp("pages") / "page.html"
    path.write_text(page_of("two cables"), encoding="utf-8")
    return path


def trouble(tab) -> str:
    assert tab.evaluate("() => document.getElementById('page').hidden")
    return tab.inner_text("#trouble")


@pytest.mark.parametrize(
    "share", [pytest.param(0.3, marks=pytest.mark.slow), 0.9, pytest.param(0.9999, marks=pytest.mark.slow)]
)
def test_a_page_whose_data_were_cut_says_so_and_draws_nothing(chromium, file, tmp_path, share):
    text = file.read_text()
    begin = text.index('<script id="robot"')
    (tmp_path / "cut.html").write_text(text[: begin + int(share * (len(text) - begin - 24))])
    tab = opened(chromium, tmp_path / "cut.html")
    assert CUT in trouble(tab)
    tab.context.close()


@pytest.mark.slow
def test_a_page_without_its_data_or_with_other_data_says_so(chromium, file, tmp_path):
    text = file.read_text()
    place = text.rindex("</script>") - 4000
    other = "A" if text[place] != "A" else "B"
    changed = {
        "none": text[: text.index('<script id="robot"')],
        "one letter": text[:place] + other + text[place + 1 :],
        "another sum": re.sub(r'data-crc="\d+"', 'data-crc="1"', text),
    }
    for name, content in changed.items():
        (tmp_path / f"{name}.html").write_text(content)
        tab = opened(chromium, tmp_path / f"{name}.html")
        assert CUT in trouble(tab), name
        tab.context.close()


@pytest.mark.slow
def test_a_page_cut_in_its_program_shows_a_sentence(chromium, file, tmp_path):
    text = file.read_text()
    (tmp_path / "cut.html").write_text(text[: text.index("async function makeRobot")])
    tab = opened(chromium, tmp_path / "cut.html", waits=False)
    assert "has not loaded completely" in trouble(tab)
    tab.context.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "word"),
    [
        ("HTMLCanvasElement.prototype.getContext = () => null", "cannot draw"),
        ("delete window.WebAssembly", "WebAssembly"),
        ("delete window.DecompressionStream", "too old"),
    ],
)
def test_what_a_browser_lacks_is_said_in_a_sentence(chromium, file, script, word):
    tab = opened(chromium, file, script)
    assert word in trouble(tab)
    tab.context.close()
