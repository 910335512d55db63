"""The page of a robot that moves: its predictive control is that of Python, and the slider runs the robots."""

from dataclasses import replace

import numpy as np
import pytest
from export.moving import model, page_of_moving, predictive, robot, spec
from export.pages import browser, opened, page_of, until

from cfem.core.errors import InputError
from cfem.export.curve import curve_of
from cfem.export.page import layout
from cfem.export.page import motion as page_motion
from cfem.export.page.motion import moves
from cfem.predict.load import build

CHOSEN = spec(mpc={"horizon": 12, "sensor": False})
TICKS = 15


@pytest.fixture(scope="module")
def runs():
    meta, arrays, moving = robot()
    return moves(meta, build(meta, arrays), moving, CHOSEN)


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def tab(chromium, tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "page.html"
    path.write_text(page_of_moving(CHOSEN), encoding="utf-8")
    one = opened(chromium, path, viewport={"width": 1280, "height": 800})
    yield one
    assert one.faults == []


def test_commands_are_those_of_python(tab, runs):
    python = predictive(CHOSEN, curve_of(model())[0])
    goals = runs.curve[:: len(runs.curve) // 64]
    told = tab.evaluate(
        "([goals, ticks]) => { const m = cfem.robot.moves; m.start(); const out = []; for (let k = 0; k < ticks; k++) "
        "{ const lost = m.tick(goals.slice(k, k + 12), 1); out.push([lost, m.command(1), m.place(1)]); } return out; }",
        [goals.tolist(), TICKS],
    )
    wanted = np.array([python.tick(goals[k], None, goals[k : k + 12]).u for k in range(TICKS)])
    assert not any(lost for lost, *_ in told)
    np.testing.assert_allclose([u for _, u, _ in told], wanted, atol=1e-8 * np.abs(wanted).max())
    there = np.array([place for *_, place in told])
    assert np.linalg.norm(there[-1] - there[0]) > 0.5  # mm: it moves
    assert np.linalg.norm(there[-1] - goals[TICKS - 1]) < 1.0


def test_the_slider_runs_both_robots_and_stops(tab):
    def slide(value):
        tab.evaluate(
            "v => { const s = document.getElementById('speed'); s.value = v; s.dispatchEvent(new Event('input')); }",
            value,
        )

    most = tab.evaluate("() => cfem.robot.moves.said.most")
    slide(most)
    until(tab, "cfem.motion.state.missed[1].length > 30", 60)
    static, ahead = tab.evaluate("() => [cfem.motion.missed(0)[0], cfem.motion.missed(1)[0]]")
    lost = tab.evaluate("() => cfem.motion.state.lost")
    assert ahead < 0.5 * static or lost == 1
    assert "Following" in tab.text_content("#words") and tab.text_content("#laps").endswith("laps a second")
    assert tab.locator("#missed td").count() == 4
    tab.click("#by-static")
    assert tab.evaluate("() => cfem.motion.state.shown") == 0
    slide(0)
    until(tab, "!cfem.state.moving")
    assert tab.text_content("#laps") == "at rest" and "On the goal" in tab.text_content("#words")


def test_a_robot_that_has_not_learned_to_move_has_no_slider(chromium, tmp_path):
    path = tmp_path / "page.html"
    path.write_text(page_of("two cables"), encoding="utf-8")
    still = opened(chromium, path)
    assert still.is_hidden("#motion") and still.evaluate("() => !cfem.robot.moves")
    still.context.close()


def test_room_ends(monkeypatch):
    meta, arrays, moving = robot()
    lists = layout.motion_layout()
    less = tuple(replace(one, most=3) if one.name == "CFEM_MOTION_NQ" else one for one in lists.counts)
    monkeypatch.setattr(page_motion, "motion_layout", lambda: replace(lists, counts=less))
    with pytest.raises(InputError, match="room for 3 motions, and this robot has 4"):
        moves(meta, build(meta, arrays), moving, CHOSEN)
