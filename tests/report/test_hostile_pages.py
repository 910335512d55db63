"""Pages whose names, labels and texts hold HTML and scripts, opened in a browser: nothing of them runs, no request
leaves, and people read what was written."""

from dataclasses import replace
from types import SimpleNamespace

import markdown
import numpy as np
import pytest
from design.problems import Plain, plain
from export.pages import ROBOTS, browser, skin_of, until
from zoo.zoo import BODIES, table

from cfem.condensed.parameters import Parameter
from cfem.design.optimisers.front import best_of_each, pareto_front
from cfem.design.optimisers.search import evaluate_grid
from cfem.design.page import STEPS, front_page
from cfem.export.firmware.embedding import Embedding
from cfem.export.page.page import page as page_of_robot
from cfem.export.spec import CSpec
from cfem.report.chart import chart, panel
from cfem.report.page import Card, Number, ReportSection, Summary, page
from cfem.report.tables import ReportTable
from cfem.report.viewer import Polyline, Take, Viewer

HOSTILE = (
    "x</script></title></textarea><script>hits.push(1);fetch('http://attacker.invalid/a')</script>"
    "<img src=http://attacker.invalid/b onerror=hits.push(2)><svg onload=hits.push(3)>"
    "\" autofocus onfocus=\"hits.push(4)\" ' onpointerenter='hits.push(5)' ${hits.push(6)} `${hits.push(7)}` {{title}}"
    "<meta http-equiv=refresh content='0;url=http://attacker.invalid/c'><a href='javascript:hits.push(8)'>here</a> -->"
)


@pytest.fixture(scope="module")
def chromium():
    with browser() as one:
        yield one


@pytest.fixture
def read(chromium, tmp_path):
    """Opens a page, waits until an expression holds, does something, and gives the text that people read."""

    def opens(html, drawn="document.readyState === 'complete'", use=lambda tab: None):
        path, asked = tmp_path / "page.html", []
        path.write_text(html, encoding="utf-8")
        context = chromium.new_context()
        context.on("request", lambda request: asked.append(request.url))
        context.add_init_script("window.hits = [];")
        tab = context.new_page()
        faults = []
        tab.on("pageerror", lambda error: faults.append(str(error)))
        tab.on("dialog", lambda dialog: faults.append(dialog.message))
        tab.goto(path.as_uri())
        until(tab, drawn)
        use(tab)
        tab.wait_for_timeout(100)
        assert tab.evaluate("() => hits") == [] and faults == []
        assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
        assert tab.url.partition("#")[0] == path.as_uri()
        text = tab.evaluate("() => document.body.innerText") + tab.title()
        context.close()
        return text

    return opens


def viewer():
    x = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]] * 3)
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    take = Take(HOSTILE, x, range(3), x[:, 3], x[:, 3], [0.0] * 3, (Polyline(HOSTILE, "--c0", x[:1]),))
    return Viewer(HOSTILE, HOSTILE, triangles, np.zeros(4, int), (take, replace(take, name=f"2 {HOSTILE}")))


def test_a_report(read):
    axis = panel("plain", "x")
    for label in (HOSTILE, f"2 {HOSTILE}"):
        axis.plot([0, 1], [0, 1], label=label.replace("$", ""))
    parts = (ReportTable((HOSTILE, HOSTILE), [(HOSTILE, HOSTILE)]), chart(HOSTILE, HOSTILE, [axis]))
    summary = Summary(HOSTILE, (HOSTILE,), (Number(HOSTILE, HOSTILE, (HOSTILE,)),))
    card = Card(viewer(), {HOSTILE: HOSTILE})
    html = page(HOSTILE, summary, viewer(), card, [ReportSection(HOSTILE, HOSTILE, parts)])

    def unfold(tab):
        for one in tab.query_selector_all("summary, nav a, button"):
            one.dispatch_event("click")

    assert read(html, use=unfold).count(HOSTILE.replace("  ", " ")[:60]) > 8


def test_the_page_of_a_robot(read):
    meta, arrays = ROBOTS["two cables"]()
    rows = {
        **meta["rows"],
        "actuators": [HOSTILE, f"2 {HOSTILE}"],
        "effectors": [f"{HOSTILE}.{axis}" for axis in "xyz"],
    }
    meta = {**meta, "scene": HOSTILE, "rows": rows}
    html = page_of_robot(meta, arrays, skin_of(meta, arrays), CSpec(), Embedding(), [HOSTILE])

    def use(tab):
        for one in tab.query_selector_all("button, label, .actuator"):
            one.dispatch_event("pointerenter")
            one.dispatch_event("click")

    text = read(html, "document.documentElement.dataset.state", use)
    assert text.count(HOSTILE[:60]) >= 4


def test_the_front_of_designs(read):
    names = (HOSTILE, f"2 {HOSTILE}", f"3 {HOSTILE}")
    functions = (lambda p: p[:, 0], lambda p: 1 - p[:, 0], lambda p: p[:, 1])
    problem = plain(**dict(zip(names, functions, strict=True)))
    problem.family = Plain()
    parameters = tuple(replace(one, name=HOSTILE, unit=HOSTILE) for one in Plain.parameters)
    problem.family.parameters = parameters
    assert all(isinstance(one, Parameter) for one in problem.parameters)
    tried = evaluate_grid(problem, (3, 3))
    front = pareto_front(problem, tried, names, 4, best_of_each(problem, tried, 1))
    x = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 1]])
    robot = SimpleNamespace(name=HOSTILE, facets=np.array([[0, 1, 2], [1, 3, 2]]), fixed=np.array([0, 1]))
    shapes = [(np.tile(x, (STEPS, 1, 1)), np.tile(x[3:], (STEPS, 1)))] * len(front.designs)
    matters = {name: {"total": {HOSTILE: 0.9, "y": 0.1}} for name in names}
    html = front_page(problem, front, robot, shapes, matters)

    def choose(tab):
        for one in tab.query_selector_all("circle"):
            one.dispatch_event("click")
        tab.select_option("#axes select", index=2)

    assert read(html, use=choose).count(HOSTILE[:60]) > 8


def test_the_table_of_bodies(read):
    """What a run says against itself quotes names of the file."""
    ran = {"name": BODIES[0].name, "reached": 3, "goals": 24, "poor": [HOSTILE], "page": True}
    ran |= {"placed": HOSTILE, "answers": [HOSTILE.replace("`", "")], "commit": "abc", "actuators": 1}
    broken = {**ran, "name": BODIES[1].name, "init": {"code": 2, "said": [HOSTILE]}}
    html = markdown.markdown(table([ran, broken]), extensions=["tables"])
    assert HOSTILE[:60] in read(f"<!doctype html><meta charset=utf-8><title>-</title>{html}")
