"""The robot of a report in a browser without a graphics card: it plays, is scrubbed and turned."""

import numpy as np
import pytest
from export.pages import PACKED, browser, opened, unpacked, until
from report.test_viewer import FACETS, FRAMES

from cfem.report.page import Summary, page
from cfem.report.viewer import BODY, HELD, Polyline, Take, Viewer

# A picture that took long has fewer pixels at first; 0.2 s after the last, the page asks for one with all of them. Its
# timer ends before this one does, and its frame is drawn before the second one from then.
PIXELS = f"""async () => {{ await new Promise(go => setTimeout(go, 300));
  for (const _ of [1, 2]) await new Promise(requestAnimationFrame);
  const canvas = document.querySelector(".viewer canvas"), {{ width, height }} = canvas;
  return [width, height, ({PACKED})(canvas.getContext("2d").getImageData(0, 0, width, height).data)]; }}"""
STILL = "matchMedia = (ask => query => query.includes('reduced-motion') ? { matches: true } : ask(query))(matchMedia)"


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    tips = FRAMES[:, 3]
    cable = Polyline("left", "--c1", np.stack([FRAMES[:, 0], tips], axis=1))
    takes = tuple(
        Take(name, x, (0, 1, 2), x[:, 3], x[:, 3], (0.1, 0.0, 1e-5), (cable,))
        for name, x in (("there", FRAMES), ("and-back", FRAMES[::-1]))
    )
    viewer = Viewer("tracked", "the body", FACETS, np.array([BODY, BODY, BODY, HELD]), takes)
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(page("robot", Summary("All is reached."), viewer, None, []), encoding="utf-8")
    return path


@pytest.fixture
def tab(chromium, file):
    """The report, which stands still."""
    one = opened(chromium, file, STILL, waits=False)
    until(one, "document.querySelector('.viewer canvas')")
    yield one
    assert one.faults == []
    one.context.close()


def picture(tab):
    wide, tall, data = tab.evaluate(PIXELS)
    return unpacked(data).reshape(tall, wide, 4)


def blue(tab):
    """Pixels of the body."""
    red, _, blue, alpha = np.moveaxis(picture(tab), 2, 0)
    return (blue > red + 40) & (alpha == 255)


def scrub(tab, time):
    tab.evaluate(
        "time => { const slide = document.querySelector('.viewer input'); slide.value = time; "
        "slide.dispatchEvent(new Event('input')); }",
        time,
    )


def test_it_draws_the_body_within_the_picture(tab):
    body = blue(tab)
    assert 0.03 < body.mean() < 0.7
    assert not (body[0].any() or body[-1].any() or body[:, 0].any() or body[:, -1].any())
    assert tab.get_attribute(".viewer canvas", "aria-label") == "the body"


@pytest.mark.slow
def test_the_reader_scrubs_and_hears_of_each_goal(tab):
    first = picture(tab)
    scrub(tab, 2)
    assert tab.inner_text(".viewer output") == "goal 3 of 3, error 10 nm"
    assert (picture(tab) != first).any(axis=2).sum() > 500
    scrub(tab, 0)
    assert tab.inner_text(".viewer output") == "goal 1 of 3, error 0.1 mm" and (picture(tab) == first).mean() > 0.99


@pytest.mark.slow
def test_the_reader_chooses_a_trajectory(tab):
    scrub(tab, 2)
    last = picture(tab)
    tab.select_option(".viewer select", label="and back")
    assert tab.inner_text(".viewer output").startswith("goal 1 of 3")
    assert (blue(tab) == (last[..., 2] > last[..., 0] + 40)).mean() > 0.98  # the other's first shape is its last


@pytest.mark.slow
def test_the_reader_turns_it(tab):
    before, box = blue(tab), tab.locator(".viewer canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(x + 120, y + 30, steps=4)
    tab.mouse.up()
    after = blue(tab)
    assert after.shape != before.shape or (after != before).sum() > 500


@pytest.mark.slow
def test_it_plays_unless_the_reader_wants_no_motion(chromium, file, tab):
    assert tab.inner_text(".viewer button") == "▶"
    playing = opened(chromium, file, waits=False)
    until(playing, "Number(document.querySelector('.viewer input')?.value) > 0.1")
    playing.context.close()


@pytest.mark.slow
def test_without_a_canvas_the_still_picture_stays(chromium, file):
    bare = opened(chromium, file, "HTMLCanvasElement.prototype.getContext = () => null", waits=False)
    assert bare.locator(".viewer img").count() == 1 and bare.locator(".viewer canvas").count() == 0
    bare.context.close()


@pytest.mark.slow
def test_nothing_is_left_of_the_shape_before(tab):
    """The picture after other shapes is that of a fresh page, at each of its pixels."""
    scrub(tab, 0)
    fresh = picture(tab)
    for time in (2, 1, 0):
        scrub(tab, time)
    stray = (picture(tab)[..., 3] > 0) != (fresh[..., 3] > 0)
    assert stray.sum() == 0
