"""The page in a real browser: it computes what Python computes, and does what pointer, keys and sliders ask."""

import re

import numpy as np
import pytest
from export.embedded import states
from export.pages import PACKED, ROBOTS, browser, opened, page_of, skin_of, surface, unpacked, until, wedge
from support.fast_cases import fast_are

from cfem.export.firmware.embedding import Embedding
from cfem.export.page.page import page
from cfem.export.spec import CSpec
from cfem.predict.load import build

EXACT = 1e-6  # mm
COMMANDS = 100
WIDE, PHONE = {"width": 1280, "height": 800}, {"width": 390, "height": 844}
OUTSIDE = 4  # of the status


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("pages")


@pytest.fixture(scope="module")
def files(folder):
    """The page of each robot, written once."""

    def file(name):
        path = folder / f"{name.replace(' ', '-')}.html"
        if not path.exists():
            path.write_text(page_of(name), encoding="utf-8")
        return path

    return file


@pytest.fixture
def tab(chromium, files):
    one = opened(chromium, files("two cables"), viewport=WIDE)
    yield one
    assert one.faults == []
    one.context.close()


def settle(tab):
    until(tab, "!cfem.state.moving")


def shown(tab) -> dict:
    """What the robot of the page says of itself; x (n, 3) of the skin alone."""
    said = tab.evaluate(
        "() => { const r = cfem.robot; r.shape(); return { delta: [...r.delta_a], lambda: [...r.lambda_a], "
        "tip: [...r.x_e], goal: [...r.goal], x: [...r.x], words: document.getElementById('words').textContent }; }"
    )
    return {key: value if key == "words" else np.array(value) for key, value in said.items()}


@pytest.mark.parametrize("name", fast_are({"two cables"}, ROBOTS))
def test_tip_and_surface_are_python_s(chromium, files, name):
    """100 commands set by hand: the effectors and every point of the surface to 1e-6 mm."""
    meta, arrays = ROBOTS[name]()
    model, skin = build(meta, arrays), skin_of(meta, arrays)
    s = states("displacement", model.rows.n_a, COMMANDS)
    tab = opened(chromium, files(name))
    there = tab.evaluate(
        "commands => commands.map(d => { const r = cfem.robot; const status = r.set(d); r.shape(); "
        "return [status & ~cfem.STATUS.OUTSIDE, [...r.lambda_a], [...r.x_e], [...r.x]]; })",
        s.tolist(),
    )
    assert len(there) == COMMANDS and not any(status for status, *_ in there)
    n = skin["rest"].size
    for command, (_, lambda_a, x_e, x) in zip(s, there, strict=True):
        expected = model.at_displacement(command)
        given = expected.lam if model.form == "force" else command
        assert np.abs(np.array(x_e) - model.rest_e - expected.delta_e).max() < EXACT
        assert np.abs(np.array(x[:n]) - surface(skin, given).ravel()).max() < EXACT
        assert np.abs(np.array(lambda_a) - expected.lam).max() < EXACT
    assert tab.faults == []
    tab.context.close()


@pytest.mark.parametrize("name", fast_are({"two cables"}, ["two cables", "modules"]))
def test_the_goal_is_dragged_and_the_robot_is_where_python_has_it(chromium, files, name):
    meta, arrays = ROBOTS[name]()
    model = build(meta, arrays)
    tab = opened(chromium, files(name), viewport=WIDE)
    settle(tab)
    before = shown(tab)
    wanted = model.rest_e + model.at_displacement(states("displacement", model.rows.n_a, 8)[5]).delta_e
    # in the plane of the screen: there and back is the same goal
    x, y = tab.evaluate("() => cfem.scene.project(cfem.state.camera, cfem.goals[0].place)")
    u, v = tab.evaluate("p => cfem.scene.project(cfem.state.camera, p)", wanted[:3].tolist())
    tab.mouse.move(x, y)
    tab.mouse.down()
    tab.mouse.move(u, v, steps=12)
    tab.mouse.up()
    there = "cfem.scene.project(cfem.state.camera, cfem.goals[0].place)"
    until(tab, f"{there}.every((at, i) => Math.abs(at - [{u}, {v}][i]) < 0.01)")  # events come when they come
    settle(tab)
    after = shown(tab)
    assert np.linalg.norm(after["goal"] - before["goal"]) > 1
    expected = model.at_displacement(after["delta"])
    assert np.abs(after["tip"] - model.rest_e - expected.delta_e).max() < EXACT
    assert np.abs(after["lambda"] - expected.lam).max() < EXACT
    missed, missed_before = (np.linalg.norm(after["goal"] - one["tip"]) for one in (after, before))
    assert missed < missed_before
    assert ("On the goal" in after["words"]) == (missed < 0.01)
    assert ("out of reach" in after["words"]) == (missed > 0.01)
    assert tab.faults == []
    tab.context.close()


@pytest.mark.slow
def test_a_goal_that_the_robot_can_reach_is_reached(tab):
    meta, arrays = ROBOTS["two cables"]()
    model = build(meta, arrays)
    for command in states("displacement", 2, 12):
        goal = model.rest_e + model.at_displacement(command).delta_e
        tab.evaluate("goal => { cfem.moveGoal(cfem.goals[0], goal); }", goal.tolist())
        settle(tab)
        if (model.at_displacement(command).lam > 0.05).all():
            assert np.linalg.norm(shown(tab)["tip"] - goal) < 1e-3


@pytest.mark.slow
def test_fingers_drag_and_zoom(chromium, files):
    tab = opened(chromium, files("two cables"), viewport=PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)
    settle(tab)
    touch = tab.context.new_cdp_session(tab)

    def fingers(kind, *points):
        places = [{"x": float(x), "y": float(y), "id": i} for i, (x, y) in enumerate(points)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})

    x, y = tab.evaluate("() => cfem.scene.project(cfem.state.camera, cfem.goals[0].place)")
    before = shown(tab)
    fingers("touchStart", (x + 20, y - 20))  # a finger is not exact
    for step in range(1, 9):
        fingers("touchMove", (x + 20 + 5 * step, y - 20 - 2 * step))
    fingers("touchEnd")
    settle(tab)
    assert np.linalg.norm(shown(tab)["goal"] - before["goal"]) > 1
    height = tab.evaluate("() => cfem.state.camera.height")
    fingers("touchStart", (120, 200), (200, 200))
    fingers("touchMove", (80, 200), (260, 200))
    fingers("touchEnd")
    assert tab.evaluate("() => cfem.state.camera.height") < 0.8 * height
    assert tab.evaluate("() => document.documentElement.scrollWidth") <= PHONE["width"]
    tab.context.close()


def test_all_of_the_robot_stays_in_the_picture_where_its_width_changes(tab):
    """At the ends of its reach too."""
    outside = """() => { const { scene, state, robot } = cfem, view = document.getElementById("view"), seen = [];
      for (const told of [[0, 0], [14, 2], [2, 14]]) {
        robot.set(told); robot.shape();
        const places = [...robot.drawn];
        for (let i = 0; i < places.length; i += 3) seen.push(scene.project(state.camera, places.slice(i, i + 3)));
      }
      robot.home(); robot.shape();
      return seen.filter(([u, v]) => u < 0 || v < 0 || u > view.clientWidth || v > view.clientHeight).length; }"""
    for width, height in ((800, 1400), (1800, 500), (780, 1000)):
        tab.set_viewport_size({"width": width, "height": height})
        until(tab, f"innerWidth === {width} && innerHeight === {height}")
        tab.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        assert tab.evaluate(outside) == 0
    tab.focus("#view")
    tab.keyboard.press("+")
    nearer = tab.evaluate("() => cfem.state.camera.height")
    tab.set_viewport_size({"width": 700, "height": 500})
    until(tab, "innerWidth === 700")
    assert tab.evaluate("() => cfem.state.camera.height") == nearer  # a person's own view stays


@pytest.mark.slow
def test_the_first_view_shows_a_wide_body_wherever_it_gets_and_its_shadow(chromium, tmp_path):
    """The tip's own way is short beside the body: the reach alone says little of where there is something to see."""
    meta, arrays = ROBOTS["one cable"]()
    skin = skin_of(meta, arrays)
    lying = skin["rest"][:, [2, 1, 0]] * [1, 3, 3]
    text = page(meta, arrays, {**skin, "rest": lying}, CSpec(), Embedding())
    (tmp_path / "lying.html").write_text(text, encoding="utf-8")
    tab = opened(chromium, tmp_path / "lying.html", viewport={"width": 1100, "height": 750})
    places = tab.evaluate(
        "() => { const { robot, state, scene, ground, shadowOf } = cfem, all = [], n = robot.n_a, { states } = robot; "
        "for (let k = 0; k + n <= states.length; k += n) { robot.set([...states.slice(k, k + n)]); robot.shape(); "
        "for (let i = 0; i < robot.drawn.length; i += 3) for (const place of [[...robot.drawn.slice(i, i + 3)], "
        "shadowOf(robot.drawn, i, ground.height)]) all.push(...scene.project(state.camera, place)); } return all; }"
    )
    across, down = np.array(places).reshape(-1, 2).T
    assert min(across) > 0 and max(across) < 740 and min(down) > 0 and max(down) < 750


def test_keys_move_the_goal_and_turn_the_view(tab):
    before, azimuth = shown(tab), tab.evaluate("() => cfem.state.camera.azimuth")
    tab.focus("#view")
    for key in ("ArrowUp", "ArrowRight", "PageUp"):
        tab.keyboard.press(key)
    settle(tab)
    after = shown(tab)
    assert np.count_nonzero(np.abs(after["goal"] - before["goal"]) > 0.1) == 3
    tab.keyboard.press("Shift+ArrowRight")
    assert tab.evaluate("() => cfem.state.camera.azimuth") != azimuth
    tab.keyboard.press("Home")
    settle(tab)
    assert np.abs(shown(tab)["goal"] - before["goal"]).max() < 1e-9


@pytest.mark.slow
def test_sliders_set_the_actuators_by_hand(tab):
    tab.evaluate(
        "() => { const s = document.getElementById('a0'); s.value = 6; "
        "s.dispatchEvent(new Event('input', {bubbles: true})); }"
    )
    settle(tab)
    after = shown(tab)
    assert after["delta"][0] == pytest.approx(6, abs=0.02) and "by hand" in after["words"]
    assert np.abs(after["goal"] - after["tip"]).max() < 1e-12
    assert tab.get_attribute("#hand", "aria-pressed") == "true"
    tab.click("#follow")
    settle(tab)
    assert shown(tab)["words"] == "On the goal."


@pytest.mark.slow
def test_a_cable_that_would_push_is_slack_and_goes_where_the_other_leads(tab):
    meta, arrays = ROBOTS["two cables"]()
    model = build(meta, arrays)
    tab.evaluate("() => cfem.robot.set([6, 0])")
    after = shown(tab)
    assert after["delta"][0] == 6 and after["delta"][1] > 0.1
    assert abs(after["lambda"][1]) < 1e-6 < after["lambda"][0]
    expected = model.at_displacement(after["delta"])
    assert np.abs(after["tip"] - model.rest_e - expected.delta_e).max() < EXACT


@pytest.mark.slow
def test_a_slack_cable_says_what_its_slider_says(tab):
    """Told 4 mm beside 14 of the other, the left one hangs: its way has become 10.7 mm shorter."""
    tab.evaluate(
        "() => [4, 14].forEach((value, i) => { const slider = document.getElementById(`a${i}`); "
        "slider.value = value; slider.dispatchEvent(new Event('input', { bubbles: true })); })"
    )
    settle(tab)
    tab.wait_for_function("document.querySelector('#actuators em').textContent.startsWith('slack by')")
    label = tab.evaluate("document.querySelector('#actuators span').textContent")
    spare = float(
        re.search(r"slack by ([\d.]+) mm", tab.evaluate("document.querySelector('#actuators em').textContent"))[1]
    )
    assert label.startswith("4.00 mm · 0.00 N")
    assert np.isclose(shown(tab)["delta"][0], 4.0 + spare, atol=0.006)


# Pixels of the picture, red, green, blue and alpha.
PIXELS = f"""() => {{ const view = document.getElementById("view"), {{ width, height }} = view;
  cfem.draw(true);
  return ({PACKED})(view.getContext("2d").getImageData(0, 0, width, height).data); }}"""


def pixels(tab, *actuators):
    """(n, 4) of the picture without reach, the actuators where they are told."""
    if tab.get_attribute("#reach", "aria-pressed") == "true":
        tab.click("#reach")
    tab.evaluate(
        "told => { const { robot, goals, chambers } = cfem; robot.set(told); robot.shape(); "
        "for (const one of chambers) one.inflate(); for (const one of goals) robot.goal.set(one.tip, one.rows[0]); }",
        list(actuators),
    )
    return unpacked(tab.evaluate(PIXELS))


@pytest.mark.slow
def test_a_robot_that_has_left_its_rest_shows_where_that_was(tab):
    """The pale colour of the ghost is the picture's where the robot has been and is not."""
    rest, bent = pixels(tab, 0, 0), pixels(tab, 14, 14)
    left = (rest[:, 3] == 255) & (bent[:, 3] < 255)
    assert left.sum() > 1000 and (bent[left, 3] > 0).mean() > 0.95
    assert (bent[left, :3].max(axis=1) < 80).mean() > 0.5  # the ink's


@pytest.mark.slow
def test_colours_of_strain_follow_the_stretch_of_the_surface(tab):
    """Against the singular values of the gradient on each triangle; the button colours by them."""
    plain = pixels(tab, 14, 2)
    triangles, rest, x = tab.evaluate(
        "() => { const { robot } = cfem; robot.home(); robot.shape(); const rest = [...robot.drawn]; "
        "robot.set([14, 2]); robot.shape(); return [[...robot.triangles], rest, [...robot.drawn]]; }"
    )
    triangles, rest, x = (np.array(one).reshape(-1, 3) for one in (triangles, rest, x))
    strains, areas = [], []
    for corners in triangles:
        sides, moved = ((at[corners[1:]] - at[corners[0]]).T for at in (rest, x))
        frame = np.linalg.qr(sides)[0]
        stretches = np.linalg.svd(moved @ np.linalg.inv(frame.T @ sides), compute_uv=False)
        strains.append(np.abs(stretches - 1).max())
        areas.append(np.linalg.norm(np.cross(*sides.T)))
    expected = [np.bincount(triangles.ravel(), np.repeat(one, 3)) for one in (np.multiply(strains, areas), areas)]
    found = np.array(tab.evaluate("() => [...cfem.strain.strains()]"))[: len(expected[0])]
    np.testing.assert_allclose(found, expected[0] / np.maximum(expected[1], 1e-30), atol=1e-4)
    assert found.max() > 0.05
    tab.click("#strain")
    assert (plain != pixels(tab, 14, 2)).any(axis=1).sum() > 1000
    assert tab.is_visible("#strained") and tab.inner_text("#strained .legend span:last-child").endswith(" %")
    assert tab.evaluate("() => cfem.state.strain") >= np.quantile(found, 0.99)
    tab.click("#strain")
    assert (plain == pixels(tab, 14, 2)).all() and not tab.is_visible("#strained")


@pytest.mark.slow
def test_an_unreachable_goal_names_the_limits(tab):
    tab.evaluate("() => cfem.moveGoal(cfem.goals[0], [20, 190, -10])")
    settle(tab)
    until(tab, "document.getElementById('words').textContent.includes('out of reach')")
    words = shown(tab)["words"]
    assert re.search(r"the tip is \d[\d.]* mm away \(cable0 and cable1 are pulled as far as they go\)\.$", words)
    assert tab.locator(".actuator em.binding").count() >= 1


@pytest.mark.slow
def test_a_goal_that_no_limit_keeps_from_the_robot_lies_beside_its_reach(tab):
    model = build(*ROBOTS["two cables"]())
    tip, one, other = (model.rest_e + model.at_displacement(at).delta_e for at in ([5.0, 5.0], [5.1, 5.0], [5.0, 5.1]))
    normal = np.cross(one - tip, other - tip)
    aside = tip + 2 * normal / np.linalg.norm(normal)
    tab.evaluate("aside => cfem.moveGoal(cfem.goals[0], aside)", aside.tolist())
    until(tab, "/^The goal lies beside the surface .* mm away\\.$/.test(document.getElementById('words').textContent)")
    assert tab.locator(".actuator em.binding").count() == 0


@pytest.mark.slow
def test_a_far_state_is_found_from_where_the_robot_is(chromium, tmp_path):
    """The cable that the other one leads is let out at once by 4 mm: between the two states the model has no answer."""
    meta, arrays = wedge()
    text = page(meta, arrays, skin_of(meta, arrays), CSpec(), Embedding())
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    tab = opened(chromium, tmp_path / "page.html")
    for asked in ([5.15, 0.0], [0.0, 5.15]):
        status = tab.evaluate("asked => cfem.robot.set(asked)", asked)
        after = shown(tab)
        q = 4.0 if asked[0] else -4.0  # difference of the two, for which the one that leads is 5.147 mm
        assert status & ~OUTSIDE == 0
        assert after["delta"] == pytest.approx([(6.2933 + q) / 2, (6.2933 - q) / 2], abs=0.01)
        assert abs(after["lambda"][asked.index(0.0)]) < 1e-6
    tab.context.close()


@pytest.mark.slow
def test_the_robot_at_rest_is_no_state_outside_of_the_model(tab):
    settle(tab)
    assert tab.inner_text("#note") == ""


@pytest.mark.slow
def test_an_actuator_that_is_pointed_at_is_drawn_thicker(tab):
    tab.hover(".actuator:nth-of-type(2)")
    assert tab.evaluate("() => cfem.state.lit") == 1
    tab.hover("h1")
    assert tab.evaluate("() => cfem.state.lit") is None


@pytest.mark.slow
def test_the_bar_of_the_scale_is_as_long_as_it_says(tab):
    for height in (200, 37, 4):
        tab.evaluate("height => { cfem.state.camera.height = height; cfem.state.shown = true; }", height)
        until(tab, f"cfem.state.camera.height === {height} && !cfem.state.shown")
        words = tab.inner_text(".overlay span")
        pixels, tall = (
            tab.locator(one).bounding_box()[side] for one, side in ((".overlay i", "width"), ("#view", "height"))
        )
        assert pixels == pytest.approx(float(words.removesuffix(" mm")) * tall / height, rel=0.02)
        assert 40 < pixels <= 112


@pytest.mark.slow
def test_the_theme_follows_the_system_and_the_button(chromium, files):
    tab = opened(chromium, files("two cables"), color_scheme="dark")
    ground = "() => getComputedStyle(document.body).backgroundColor"
    dark = tab.evaluate(ground)
    tab.click("#theme")
    light = tab.evaluate(ground)
    assert sum(map(int, re.findall(r"\d+", dark)[:3])) < 200 < 600 < sum(map(int, re.findall(r"\d+", light)[:3]))
    tab.context.close()


def test_nothing_but_the_file_is_asked_for(chromium, files):
    there = chromium.new_context()
    tab, asked = there.new_page(), []
    tab.on("request", lambda request: asked.append(request.url))
    tab.goto(files("two cables").as_uri())
    until(tab, "window.cfem !== undefined")
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == [] and len(asked) == 1
    there.close()
